// What the server finds in a file when it is uploaded, beside its size.
#ifndef LITAGS_SERVER_READER_FILE_FINDINGS_H_
#define LITAGS_SERVER_READER_FILE_FINDINGS_H_

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/types/span.h"

namespace litags {

struct PhotoFindings {
  // As ImageInfo has them; 0: EXIF does not say.
  double focal_length = 0, exposure_time = 0, iso = 0, f_number = 0;
  // As ScreenedPhoto has them.
  double mean_code = 0, light = 0, structure = 0, sharpness = 0, fine_detail = 0, coarse_detail = 0;
  double has_views = 0;  // 0 or 1
  std::string pixels;
};

struct VideoFindings {
  double seconds = 0, frames = 0;  // as VideoInfo has them
};

// Whose photos the cameras of a file are.
class CameraFindings {
 public:
  // `paths`: of the photos, one at least, as CheckCameras() has them.
  static CameraFindings Of(absl::Span<const std::string> paths);
  // False: NameIndex finds no camera of the file for this photo. True of about one in 2^32 / keys
  // others, too.
  bool MayHave(std::string_view photo) const;
  // As the engine's, likewise.
  int HowNamed(const std::string& photo) const;

  std::string path;            // one of them, for messages
  std::vector<uint32_t> keys;  // hashes of KeysOf() of them all, sorted
};

// As FileRecord::about, one line. Of more keys than a row should hold: empty.
std::string Encode(const PhotoFindings& findings);
std::string Encode(const VideoFindings& findings);
std::string Encode(const CameraFindings& findings);
// nullopt: it is of another version or kind, or of a process that a stranger's file has taken over.
std::optional<PhotoFindings> ParsePhotoFindings(std::string_view about);
std::optional<VideoFindings> ParseVideoFindings(std::string_view about);
std::optional<CameraFindings> ParseCameraFindings(std::string_view about);

}  // namespace litags

#endif  // LITAGS_SERVER_READER_FILE_FINDINGS_H_
