// What the server finds in a photo or a video when it is uploaded, beside its size.
#ifndef LITAGS_SERVER_READER_FILE_FINDINGS_H_
#define LITAGS_SERVER_READER_FILE_FINDINGS_H_

#include <optional>
#include <string>
#include <string_view>

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

// As FileRecord::about, one line.
std::string Encode(const PhotoFindings& findings);
std::string Encode(const VideoFindings& findings);
// nullopt: it is of another version or kind, or of a process that a stranger's file has taken over.
std::optional<PhotoFindings> ParsePhotoFindings(std::string_view about);
std::optional<VideoFindings> ParseVideoFindings(std::string_view about);

}  // namespace litags

#endif  // LITAGS_SERVER_READER_FILE_FINDINGS_H_
