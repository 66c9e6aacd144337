#include "client/upload.h"

#include <openssl/evp.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <string_view>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/types/span.h"
#include "client/status.h"
#include "client/text.h"
#include "proto/litags/v1/limits.h"

namespace litags::client {
namespace {

namespace fs = std::filesystem;

constexpr size_t kChunkBytes = 256 << 10;
// One stream acknowledges at most this much (or one larger file).
constexpr int64_t kStreamBytes = 8 << 20;
constexpr size_t kStreamFiles = 500;
static_assert(kChunkBytes <= v1::kMaxChunkBytes && kStreamFiles <= v1::kMaxQueryFiles);
constexpr std::chrono::seconds kQueryPatience{60};

using Endings = absl::Span<const std::string_view>;

bool HasEnding(const fs::path& path, Endings endings) {
  const std::string name = absl::AsciiStrToLower(path.filename().string());
  return std::any_of(endings.begin(), endings.end(), [&](std::string_view ending) {
    return name.size() > ending.size() && std::string_view(name).ends_with(ending);
  });
}

absl::Status Unreadable(const std::string& path, const std::string& why) {
  return BadInput("FILE_UNREADABLE", path,
                  absl::StrCat(path, ": cannot be read (", why,
                               "); check that it exists and may "
                               "be read"));
}

absl::StatusOr<LocalFile> MakeLocalFile(const fs::path& path, v1::FileRole role) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  if (error) return Unreadable(path.string(), error.message());
  LocalFile file;
  file.path = path.string();
  file.name = path.filename().string();
  file.role = role;
  file.size_bytes = static_cast<int64_t>(size);
  if (!IsUtf8(file.name)) {
    return BadInput("BAD_FILE_NAME", Printable(file.path),
                    absl::StrCat(Printable(file.path),
                                 ": the file's name is not UTF-8; rename it, for instance with "
                                 "convmv or mv"));
  }
  return file;
}

std::string Joined(Endings endings) {
  return absl::StrJoin(endings, " ",
                       [](std::string* out, std::string_view ending) { out->append(ending); });
}

// Subfolders with photos in them, for a hint.
std::string FoldersWithPhotos(const fs::path& dir) {
  std::string found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(dir, error)) {
    if (!entry.is_directory(error)) continue;
    for (const auto& inner : fs::directory_iterator(entry.path(), error)) {
      if (!HasEnding(inner.path(), v1::kPhotoEndings)) continue;
      absl::StrAppend(&found, found.empty() ? "" : ", ", entry.path().string());
      break;
    }
  }
  return found;
}

bool IsColmapModel(const fs::path& dir) {
  std::error_code ignored;
  return fs::exists(dir / "cameras.bin", ignored) || fs::exists(dir / "cameras.txt", ignored);
}

// How many images a COLMAP model has: the first number of images.bin, or the lines of images.txt,
// which are two for each.
uint64_t ImagesOf(const fs::path& dir) {
  uint64_t count = 0;
  std::ifstream binary(dir / "images.bin", std::ios::binary);
  if (binary.read(reinterpret_cast<char*>(&count), sizeof(count))) return count;
  std::ifstream text(dir / "images.txt");
  for (std::string line; std::getline(text, line);) count += !line.starts_with('#');
  return count / 2;
}

// What is meant by a folder: as the engine's ResolveCameras, it itself, the largest of the models
// inside or inside its folder sparse, or its transforms.json.
fs::path ResolveCameras(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored) || IsColmapModel(path)) return path;
  std::vector<fs::path> models;
  for (const fs::path& parent : {path, path / "sparse"}) {
    for (const auto& entry : fs::directory_iterator(parent, ignored)) {
      if (IsColmapModel(entry.path())) models.push_back(entry.path());
    }
  }
  std::sort(models.begin(), models.end());
  const auto largest = std::max_element(
      models.begin(), models.end(),
      [](const fs::path& a, const fs::path& b) { return ImagesOf(a) < ImagesOf(b); });
  if (largest != models.end()) return *largest;
  const fs::path json = path / "transforms.json";
  return fs::is_regular_file(json, ignored) ? json : path;
}

// The files of a COLMAP model, in text form if there is no binary one; it may have no points.
absl::Status AddColmapModel(const std::string& dir, Capture* capture) {
  std::error_code ignored;  // MakeLocalFile says what is wrong
  const bool text = !fs::exists(fs::path(dir) / "cameras.bin", ignored) &&
                    fs::exists(fs::path(dir) / "cameras.txt", ignored);
  for (const char* stem : {"cameras", "images", "points3D"}) {
    const fs::path path = fs::path(dir) / absl::StrCat(stem, text ? ".txt" : ".bin");
    if (std::string_view(stem) == "points3D" && !fs::exists(path, ignored)) continue;
    auto file = MakeLocalFile(path, v1::FILE_ROLE_COLMAP);
    if (!file.ok()) return file.status();
    capture->bytes += file->size_bytes;
    capture->files.push_back(*std::move(file));
  }
  return absl::OkStatus();
}

// "17 pictures are of a kind that is not read, 0001.webp for one: convert them to JPEG or PNG".
std::string DescribeOtherPictures(const std::vector<std::string>& names) {
  constexpr std::string_view kOther[] = {".bmp", ".gif", ".exr", ".hdr", ".jp2", ".psd", ".crw"};
  std::vector<std::string> others;
  for (const std::string& name : names) {
    if (HasEnding(name, v1::kVideoEndings)) return absl::StrCat("give the video itself: ", name);
    if (HasEnding(name, kOther)) others.push_back(name);
  }
  if (others.empty()) return "";
  std::sort(others.begin(), others.end());
  return absl::StrCat(others.size(), others.size() == 1 ? " file is" : " files are",
                      " of a kind that is not read, ", others[0],
                      others.size() == 1 ? "" : " for one", ": convert to JPEG or PNG");
}

// Adds the files of one folder; those with other endings go to capture->skipped.
absl::Status ScanFolder(const std::string& dir, std::string_view field, v1::FileRole role,
                        Endings endings, Capture* capture) {
  std::error_code error;
  if (!fs::is_directory(dir, error)) {
    return BadInput(
        "FOLDER_MISSING", field,
        absl::StrCat(dir,
                     fs::exists(dir, error) ? ": is not a folder" : ": there is no such folder",
                     "; give the folder that holds the photos"));
  }
  bool empty = true;
  for (const auto& entry : fs::directory_iterator(dir, error)) {
    if (entry.path().filename().string().starts_with(".")) continue;
    empty = false;
    std::error_code entry_error;
    if (!entry.is_regular_file(entry_error)) continue;
    if (!HasEnding(entry.path(), endings)) {
      capture->skipped.push_back(entry.path().filename().string());
      continue;
    }
    auto file = MakeLocalFile(entry.path(), role);
    if (!file.ok()) return file.status();
    capture->bytes += file->size_bytes;
    capture->files.push_back(*std::move(file));
  }
  if (error) return Unreadable(dir, error.message());
  if (empty) {
    return BadInput("FOLDER_EMPTY", field,
                    absl::StrCat(dir,
                                 ": the folder is empty; give the folder that holds the "
                                 "photos"));
  }
  return absl::OkStatus();
}

absl::Status AddMasks(Capture* capture) {
  const size_t others = capture->files.size();
  const absl::Status status =
      ScanFolder(capture->masks_dir, "--masks", v1::FILE_ROLE_MASK, v1::kMaskEndings, capture);
  if (!status.ok() || capture->files.size() > others) return status;
  return BadInput("NO_MASKS", "--masks",
                  absl::StrCat(capture->masks_dir,
                               ": holds no masks (.png); name them <photo's name>.png, or remove "
                               "the folder"));
}

absl::Status FillDigest(LocalFile& file) {
  if (!file.sha256.empty()) return absl::OkStatus();
  auto digest = FileSha256(file.path);
  if (!digest.ok()) return digest.status();
  file.sha256 = *std::move(digest);
  return absl::OkStatus();
}

void FillHeader(const LocalFile& file, v1::FileHeader* header) {
  header->set_name(file.name);
  header->set_role(file.role);
  header->set_size_bytes(file.size_bytes);
  header->set_sha256(file.sha256);
}

// The bytes of a file from `offset` on, as chunks; `*open` turns false when the server takes no
// more.
absl::Status SendBytes(const LocalFile& file, int64_t offset,
                       grpc::ClientWriter<v1::UploadImagesRequest>& writer, bool* open) {
  v1::UploadImagesRequest request;
  std::ifstream in(file.path, std::ios::binary);
  in.seekg(offset);
  std::string chunk(kChunkBytes, '\0');
  for (int64_t left = file.size_bytes - offset; left > 0 && *open;) {
    const auto n = static_cast<std::streamsize>(std::min<int64_t>(left, kChunkBytes));
    if (!in.read(chunk.data(), n)) {
      return BadInput("FILE_CHANGED", file.path,
                      absl::StrCat(file.path,
                                   ": became shorter while it was sent; submit again when nothing "
                                   "writes to it"));
    }
    request.set_chunk(chunk.data(), static_cast<size_t>(n));
    *open = writer.Write(request);
    left -= n;
  }
  return absl::OkStatus();
}

// The files that go up in one stream, and what the server has of them.
class Batch {
 public:
  Batch(Client& client, const std::string& job, absl::Span<const LocalFile> files)
      : client_(client), job_(job), files_(files) {}

  // One try: asks what is missing and sends it. `*progressed` if the server had more than at the
  // try before. On OK all files are stored.
  absl::Status Send(bool* progressed) {
    const int64_t before = known_bytes_;
    if (const absl::Status status = Query(); !status.ok()) return status;
    *progressed = known_bytes_ > before;
    return Stream();
  }

  const v1::UploadImagesResponse& response() const { return response_; }

 private:
  absl::Status Query() {
    v1::QueryUploadRequest request;
    request.set_name(job_);
    for (const LocalFile& file : files_) FillHeader(file, request.add_files());
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kQueryPatience);
    Interrupt::Scope scope(client_.interrupt(), context);
    status_.Clear();
    const absl::Status status =
        FromGrpc(client_.reconstruction().QueryUpload(&context, request, &status_));
    if (!status.ok()) return status;
    if (status_.files_size() != request.files_size()) {
      return LocalError(absl::StatusCode::kInternal, "UPLOAD_BROKEN", "files",
                        "the server did not answer for every file; this is a defect of it");
    }
    known_bytes_ = 0;
    for (const v1::FileStatus& file : status_.files()) known_bytes_ += file.offset();
    return absl::OkStatus();
  }

  absl::Status Stream() {
    grpc::ClientContext context;
    Interrupt::Scope scope(client_.interrupt(), context);
    response_.Clear();
    const auto writer = client_.reconstruction().UploadImages(&context, &response_);
    v1::UploadImagesRequest request;
    request.set_name(job_);
    bool open = writer->Write(request);
    int sent = 0;
    for (size_t i = 0; i < files_.size() && open; ++i) {
      const v1::FileStatus& there = status_.files(static_cast<int>(i));
      if (there.stored()) continue;
      FillHeader(files_[i], request.mutable_file());
      request.mutable_file()->set_offset(there.offset());
      open = writer->Write(request);
      ++sent;
      const absl::Status local = SendBytes(files_[i], there.offset(), *writer, &open);
      if (!local.ok()) {
        context.TryCancel();
        (void)writer->Finish();
        return local;
      }
    }
    request.mutable_end()->set_files(sent);
    if (open) writer->Write(request);
    writer->WritesDone();  // whether this works shows in the status
    const absl::Status status = FromGrpc(writer->Finish());
    if (!status.ok() || response_.files_received() == sent) return status;
    return LocalError(absl::StatusCode::kInternal, "UPLOAD_BROKEN", "files",
                      absl::StrCat("the server has ", response_.files_received(), " of ", sent,
                                   " files that were sent; this is a defect of it"));
  }

  Client& client_;
  const std::string& job_;
  const absl::Span<const LocalFile> files_;
  v1::QueryUploadResponse status_;
  v1::UploadImagesResponse response_;
  int64_t known_bytes_ = 0;
};

// As the service has it: two do not make a scene.
constexpr int kMinPhotos = 3;

std::string StemOf(const std::string& name) { return name.substr(0, name.rfind('.')); }

bool IsMaskOf(const std::string& photo, const std::string& mask) {
  const std::string of = StemOf(mask);
  for (const std::string& name : {photo, StemOf(photo)}) {
    if (of == name || of == name + "_mask" || of == name + ".mask") return true;
  }
  return false;
}

// If `status` says that the service cannot read one of the photos and enough others remain, takes
// that one out of `files`, with its mask; the files are sorted by role, photos first.
bool LeaveOutUnreadable(const absl::Status& status, std::vector<LocalFile>* files,
                        UploadProgress* progress) {
  if (status.ok()) return false;
  const v1::ErrorDetail detail = DetailOf(status);
  if (!detail.reason().starts_with("IMAGE_") && detail.reason() != "FILE_EMPTY") return false;
  const auto is_photo = [](const LocalFile& f) { return f.role == v1::FILE_ROLE_PHOTO; };
  const auto bad = std::find_if(files->begin(), files->end(), [&](const LocalFile& f) {
    return is_photo(f) && detail.field() == absl::StrCat("images[", f.name, "]");
  });
  if (bad == files->end()) return false;
  if (std::count_if(files->begin(), files->end(), is_photo) <= kMinPhotos) return false;
  const std::string photo = bad->name;
  progress->left_out.push_back(absl::StrCat(photo, " is left out: ", status.message()));
  std::erase_if(*files, [&](const LocalFile& f) {
    const bool gone =
        is_photo(f) ? f.name == photo : f.role == v1::FILE_ROLE_MASK && IsMaskOf(photo, f.name);
    if (gone) progress->bytes -= f.size_bytes;
    return gone;
  });
  progress->files = static_cast<int>(files->size());
  return true;
}

}  // namespace

absl::StatusOr<Capture> ScanCapture(const std::string& photos_dir, const std::string& cameras_path,
                                    const std::string& depth_dir, const std::string& masks_dir) {
  Capture capture;
  std::error_code is_no_file;
  absl::Status status;
  const bool archive = HasEnding(photos_dir, v1::kArchiveEndings);
  if (fs::is_regular_file(photos_dir, is_no_file) &&
      (archive || HasEnding(photos_dir, v1::kVideoEndings))) {
    auto file = MakeLocalFile(photos_dir, archive ? v1::FILE_ROLE_ARCHIVE : v1::FILE_ROLE_VIDEO);
    if (!file.ok()) return file.status();
    capture.bytes += file->size_bytes;
    capture.files.push_back(*std::move(file));
  } else {
    status = ScanFolder(photos_dir, "DIR", v1::FILE_ROLE_PHOTO, v1::kPhotoEndings, &capture);
  }
  if (!status.ok()) return status;
  if (capture.files.empty()) {
    const std::string inside = FoldersWithPhotos(photos_dir);
    const std::string others = DescribeOtherPictures(capture.skipped);
    return BadInput(
        "NO_PHOTOS", "DIR",
        absl::StrCat(photos_dir, ": holds no photos (", Joined(v1::kPhotoEndings), "); ",
                     !others.empty()  ? others
                     : inside.empty() ? "give the folder that holds them"
                                      : absl::StrCat("did you mean ", inside, "?")));
  }
  const std::string resolved = ResolveCameras(cameras_path).string();
  if (resolved != cameras_path) capture.notes.push_back(absl::StrCat("cameras: ", resolved));
  if (std::error_code error; fs::is_directory(resolved, error)) {
    status = AddColmapModel(resolved, &capture);
    if (!status.ok()) return status;
  } else if (!resolved.empty()) {
    if (!fs::is_regular_file(resolved, error)) {
      return Unreadable(resolved, error ? error.message() : "not a file");
    }
    auto cameras = MakeLocalFile(resolved, v1::FILE_ROLE_CAMERAS);
    if (!cameras.ok()) return cameras.status();
    capture.bytes += cameras->size_bytes;
    capture.files.push_back(*std::move(cameras));
  }
  if (!depth_dir.empty()) {
    status = ScanFolder(depth_dir, "--depth", v1::FILE_ROLE_DEPTH, v1::kDepthEndings, &capture);
    if (!status.ok()) return status;
  }
  capture.masks_dir = masks_dir;
  const fs::path beside = fs::path(photos_dir) / "masks";
  if (std::error_code ignored; masks_dir.empty() && fs::is_directory(beside, ignored)) {
    capture.masks_dir = beside.string();
  }
  if (!capture.masks_dir.empty()) {
    status = AddMasks(&capture);
    if (!status.ok()) return status;
  }
  std::sort(capture.files.begin(), capture.files.end(), [](const auto& a, const auto& b) {
    return std::pair(a.role, a.name) < std::pair(b.role, b.name);
  });
  std::sort(capture.skipped.begin(), capture.skipped.end());
  return capture;
}

absl::StatusOr<std::string> FileSha256(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return Unreadable(path, std::generic_category().message(errno));
  const std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context(EVP_MD_CTX_new(),
                                                                   EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr);
  std::string chunk(kChunkBytes, '\0');
  while (in.read(chunk.data(), kChunkBytes) || in.gcount() > 0) {
    EVP_DigestUpdate(context.get(), chunk.data(), static_cast<size_t>(in.gcount()));
  }
  if (in.bad()) return Unreadable(path, "read error");
  std::string digest(32, '\0');
  EVP_DigestFinal_ex(context.get(), reinterpret_cast<unsigned char*>(digest.data()), nullptr);
  return digest;
}

absl::Status UploadFiles(Client& client, const std::string& job, std::vector<LocalFile>& files,
                         absl::FunctionRef<void(const UploadProgress&)> on_progress, bool strict) {
  UploadProgress progress;
  progress.files = static_cast<int>(files.size());
  for (const LocalFile& file : files) progress.bytes += file.size_bytes;
  on_progress(progress);
  for (size_t first = 0; first < files.size();) {
    size_t last = first;
    int64_t bytes = 0;
    while (last < files.size() && last - first < kStreamFiles &&
           (last == first || bytes + files[last].size_bytes <= kStreamBytes)) {
      bytes += files[last++].size_bytes;
    }
    Batch batch(client, job, absl::MakeConstSpan(files).subspan(first, last - first));
    for (size_t i = first; i < last; ++i) {
      if (const absl::Status status = FillDigest(files[i]); !status.ok()) return status;
    }
    const absl::Status status =
        client.Retry([&](bool* progressed) { return batch.Send(progressed); });
    if (!strict && LeaveOutUnreadable(status, &files, &progress)) continue;
    if (!status.ok()) return status;
    progress.files_done += static_cast<int>(last - first);
    progress.bytes_done += bytes;
    for (const std::string& name : batch.response().skipped()) progress.skipped.push_back(name);
    on_progress(progress);
    first = last;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ContentDigest(std::vector<LocalFile>& files) {
  const std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context(EVP_MD_CTX_new(),
                                                                   EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr);
  for (LocalFile& file : files) {
    if (const absl::Status status = FillDigest(file); !status.ok()) return status;
    // Names hold no line breaks, so that no two captures give the same text.
    const std::string line = absl::StrCat(static_cast<int>(file.role), "/", file.name, "\n");
    EVP_DigestUpdate(context.get(), line.data(), line.size());
    EVP_DigestUpdate(context.get(), file.sha256.data(), file.sha256.size());
  }
  std::string digest(32, '\0');
  EVP_DigestFinal_ex(context.get(), reinterpret_cast<unsigned char*>(digest.data()), nullptr);
  return digest;
}

}  // namespace litags::client
