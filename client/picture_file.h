// Files that the client writes: pictures and scenes, whole or not at all.
#ifndef LITAGS_CLIENT_PICTURE_FILE_H_
#define LITAGS_CLIENT_PICTURE_FILE_H_

#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "litags/v1/render_service.pb.h"

namespace litags::client {

// A file that takes its name only when it is complete: written as PATH.<8 hex digits>.part, then
// renamed. Without Commit() nothing is left behind. A symbolic link stays one: the file that it
// names is replaced. What is no file (/dev/stdout, a FIFO) is written to as it is.
// Errors: INVALID_ARGUMENT (OUTPUT_NOT_WRITABLE) if it cannot be made, RESOURCE_EXHAUSTED
// (OUTPUT_DISK_FULL) or DATA_LOSS (OUTPUT_FAILED) later.
class OutputFile {
 public:
  // `field`: the option that names the file, for errors.
  explicit OutputFile(std::string field = "-o") : field_(std::move(field)) {}
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  // Begins the file, or begins it anew. What is no file cannot be begun anew after a Write(). The
  // other calls need one that was OK.
  absl::Status Open(const std::string& path);
  absl::Status Write(std::string_view bytes);
  absl::Status Commit();
  // Of what is open: for another program that writes it.
  int descriptor() const { return fileno(file_); }

 private:
  // Closes and removes what was begun.
  void Discard();
  absl::Status NotOpen() const;
  absl::Status Failed();

  std::string field_, path_;
  std::string target_, part_path_;  // both empty: `path_` is no file, and is written to directly
  std::FILE* file_ = nullptr;
  bool written_ = false;
};

// How a picture's file is named: .png, .jpg or .jpeg, .npy (float32, [height, width, planes]), .raw
// (the same without a header). INVALID_ARGUMENT (PICTURE_FORMAT_UNKNOWN) for others.
absl::StatusOr<v1::PictureFormat> PictureFormatOf(const std::string& path);

// The file's content: the bytes of the view, with an NPY header where `path` ends with .npy.
absl::StatusOr<std::string> PictureFileBytes(const std::string& path, const v1::RenderedView& view);

// Writes a file with this content, whole or not at all.
absl::Status WriteWhole(const std::string& path, std::string_view bytes);

// Writes a picture in the format its name says.
absl::Status WritePicture(const std::string& path, const v1::RenderedView& view);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_PICTURE_FILE_H_
