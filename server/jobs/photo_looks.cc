#include "server/jobs/photo_looks.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace litags {

ScreenedPhoto LookOf(const FileRecord& photo, const PhotoFindings& findings, bool with_cameras) {
  ScreenedPhoto look;
  look.name = photo.name;
  look.width = photo.width;
  look.height = photo.height;
  look.mean_code = findings.mean_code;
  look.light = findings.light;
  look.structure = findings.structure;
  look.sharpness = findings.sharpness;
  look.detail = {.fine = findings.fine_detail, .coarse = findings.coarse_detail};
  look.pixels = findings.pixels;
  if (look.pixels.empty()) look.flat = std::array<uint8_t, 3>{};  // of a colour that is not known
  look.has_views = findings.has_views != 0 && !with_cameras;
  return look;
}

std::vector<std::string> WhyLeftOutAsFound(absl::Span<const ScreenedPhoto> photos) {
  std::vector<std::string> why = WhyLeftOut(photos);
  for (size_t i = 0; i < photos.size(); ++i) {
    if (photos[i].flat.has_value()) why[i] = "is of one colour";
  }
  return why;
}

}  // namespace litags
