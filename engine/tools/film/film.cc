#include "engine/tools/film/film.h"

#include "absl/status/statusor.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/image_io.h"
#include "engine/tools/film/video_writer.h"

namespace litags {
namespace {

constexpr char kField[] = "--video";
// More than the largest picture that a server renders, of 16 megapixels with 16 bits, can have.
constexpr size_t kMostBytes = size_t{256} << 20;

absl::Status EndedEarly() {
  return MakeError(absl::StatusCode::kCancelled, "VIDEO_CUT_SHORT", kField,
                   "the pictures ended early; no video is written");
}

// Empty: there is no further one.
absl::StatusOr<std::string> ReadPicture(std::FILE* in) {
  char line[24];
  if (std::fgets(line, sizeof(line), in) == nullptr) return EndedEarly();
  size_t length = 0;
  if (!absl::SimpleAtoi(line, &length) || length > kMostBytes) {
    return InvalidInput("VIDEO_INPUT_INVALID", kField,
                        absl::StrCat("standard input: no length of a picture, of 1 to ", kMostBytes,
                                     " bytes; let litags path --video write it"));
  }
  std::string bytes(length, '\0');
  if (std::fread(bytes.data(), 1, length, in) != length) return EndedEarly();
  return bytes;
}

}  // namespace

absl::Status WriteFilm(std::FILE* in, std::FILE* out, std::FILE* video, const std::string& path,
                       int frames_per_second) {
  if (video == nullptr) {
    return InvalidInput("VIDEO_INPUT_INVALID", kField,
                        "--descriptor is no open file; let litags path --video start this program");
  }
  LITAGS_ASSIGN_OR_RETURN(const auto writer,
                          VideoWriter::Create(video, path, frames_per_second, kField));
  std::fprintf(out, "%s\n", kFilmReady);
  std::fflush(out);
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadPicture(in));
    if (bytes.empty()) return writer->Finish();
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, DecodeImage(bytes, kField));
    LITAGS_RETURN_IF_ERROR(writer->Add(picture));
  }
}

}  // namespace litags
