#include "client/picture_file.h"

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "client/client.h"
#include "client/status.h"

namespace litags::client {
namespace {

namespace fs = std::filesystem;

std::string Extension(const std::string& path) {
  return absl::AsciiStrToLower(fs::path(path).extension().string());
}

// What a symbolic link names in the end, whether it is there or not; other paths as they are.
std::string WithoutLinks(fs::path path) {
  constexpr int kMostLinks = 40;  // of Linux
  std::error_code error;
  for (int i = 0; i < kMostLinks && fs::is_symlink(path, error); ++i) {
    path = path.parent_path() / fs::read_symlink(path, error);
  }
  return path.string();
}

// NPY format 1.0: magic, version, header length, a Python dict, padding so that data begin at a
// multiple of 64.
std::string NpyHeader(int height, int width, int planes) {
  std::string dict = absl::StrCat("{'descr': '<f4', 'fortran_order': False, 'shape': (", height,
                                  ", ", width, ", ", planes, "), }");
  constexpr size_t kPrefix = 10;
  while ((kPrefix + dict.size() + 1) % 64 != 0) dict.push_back(' ');
  dict.push_back('\n');
  std::string header("\x93NUMPY\x01\x00", 8);
  header.push_back(static_cast<char>(dict.size() & 0xFF));
  header.push_back(static_cast<char>(dict.size() >> 8));
  return header + dict;
}

}  // namespace

OutputFile::~OutputFile() { Discard(); }

void OutputFile::Discard() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  file_ = nullptr;
  if (!part_path_.empty()) std::remove(part_path_.c_str());
}

absl::Status OutputFile::Open(const std::string& path) {
  if (file_ != nullptr && part_path_.empty()) {
    if (!written_) return absl::OkStatus();
    return LocalError(absl::StatusCode::kDataLoss, "OUTPUT_FAILED", field_,
                      absl::StrCat(path_,
                                   ": the connection broke, and what is no file cannot be "
                                   "begun anew; run the command again"));
  }
  Discard();
  path_ = path;
  target_.clear();
  part_path_.clear();
  written_ = false;
  std::error_code ignored;
  const fs::file_status there = fs::status(path, ignored);
  if (fs::is_directory(there)) {
    errno = EISDIR;
  } else if (fs::exists(there) && !fs::is_regular_file(there)) {
    file_ = std::fopen(path.c_str(), "wbe");
  } else {
    target_ = WithoutLinks(path);
    part_path_ = absl::StrCat(target_, ".", RandomId().substr(0, 8), ".part");
    file_ = std::fopen(part_path_.c_str(), "wbxe");
  }
  if (file_ != nullptr) return absl::OkStatus();
  return BadInput(
      "OUTPUT_NOT_WRITABLE", field_,
      absl::StrCat(path, ": cannot be written (", std::generic_category().message(errno),
                   "); choose another name or make its folder"));
}

absl::Status OutputFile::Write(std::string_view bytes) {
  if (file_ == nullptr) return NotOpen();
  written_ = true;
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) return Failed();
  return absl::OkStatus();
}

absl::Status OutputFile::Commit() {
  if (file_ == nullptr) return NotOpen();
  std::FILE* file = file_;
  if (std::fflush(file) != 0) return Failed();
  file_ = nullptr;
  if (std::fclose(file) == 0 &&
      (part_path_.empty() || std::rename(part_path_.c_str(), target_.c_str()) == 0)) {
    return absl::OkStatus();
  }
  const absl::Status status = Failed();
  if (!part_path_.empty()) std::remove(part_path_.c_str());
  return status;
}

absl::Status OutputFile::NotOpen() const {
  return LocalError(absl::StatusCode::kDataLoss, "OUTPUT_FAILED", field_,
                    absl::StrCat(path_, ": is not open; begin it with Open"));
}

absl::Status OutputFile::Failed() {
  const int error = errno;
  const bool full = error == ENOSPC || error == EDQUOT;
  return LocalError(full ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kDataLoss,
                    full ? "OUTPUT_DISK_FULL" : "OUTPUT_FAILED", field_,
                    absl::StrCat(path_, ": ", std::generic_category().message(error),
                                 "; free some space or write elsewhere"));
}

absl::StatusOr<v1::PictureFormat> PictureFormatOf(const std::string& path) {
  const std::string extension = Extension(path);
  if (extension == ".png") return v1::PICTURE_FORMAT_PNG;
  if (extension == ".jpg" || extension == ".jpeg") return v1::PICTURE_FORMAT_JPEG;
  if (extension == ".npy" || extension == ".raw") return v1::PICTURE_FORMAT_RAW_FLOAT;
  return BadInput("PICTURE_FORMAT_UNKNOWN", "-o",
                  absl::StrCat(path,
                               ": the name does not say a picture format; end it with .png, "
                               ".jpg, .npy or .raw"));
}

absl::StatusOr<std::string> PictureFileBytes(const std::string& path,
                                             const v1::RenderedView& view) {
  if (Extension(path) != ".npy") return view.data();
  const uint64_t expected = uint64_t{4} * static_cast<uint64_t>(view.width()) *
                            static_cast<uint64_t>(view.height()) *
                            static_cast<uint64_t>(view.planes());
  if (view.data().size() != expected) {
    return LocalError(absl::StatusCode::kInternal, "PICTURE_BROKEN", "data",
                      absl::StrCat("a picture of ", view.width(), "x", view.height(), "x",
                                   view.planes(), " floats has ", view.data().size(), " bytes"));
  }
  return NpyHeader(view.height(), view.width(), view.planes()) + view.data();
}

absl::Status WriteWhole(const std::string& path, std::string_view bytes) {
  OutputFile file;
  absl::Status status = file.Open(path);
  if (status.ok()) status = file.Write(bytes);
  if (status.ok()) status = file.Commit();
  return status;
}

absl::Status WritePicture(const std::string& path, const v1::RenderedView& view) {
  const auto bytes = PictureFileBytes(path, view);
  if (!bytes.ok()) return bytes.status();
  return WriteWhole(path, *bytes);
}

}  // namespace litags::client
