// What the server finds in a photo when it is uploaded, beside its size.
#ifndef LITAGS_SERVER_READER_PHOTO_FINDINGS_H_
#define LITAGS_SERVER_READER_PHOTO_FINDINGS_H_

#include <optional>
#include <string>
#include <string_view>

namespace litags {

struct PhotoFindings {
  // As ImageInfo has them; 0: EXIF does not say.
  double focal_length = 0, exposure_time = 0, iso = 0, f_number = 0;
  // As ScreenedPhoto has them.
  double mean_code = 0, light = 0, structure = 0;
  std::string pixels;
};

// As FileRecord::about, one line.
std::string Encode(const PhotoFindings& findings);
// nullopt: it is of another version, or of a process that a stranger's file has taken over.
std::optional<PhotoFindings> ParseFindings(std::string_view about);

}  // namespace litags

#endif  // LITAGS_SERVER_READER_PHOTO_FINDINGS_H_
