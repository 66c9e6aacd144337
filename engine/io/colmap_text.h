// COLMAP's text model: cameras.txt, images.txt, points3D.txt.
#ifndef LITAGS_ENGINE_IO_COLMAP_TEXT_H_
#define LITAGS_ENGINE_IO_COLMAP_TEXT_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace litags {

// The bytes of cameras.bin, images.bin and points3D.bin.
struct ColmapBytes {
  std::string cameras, images, points;
};

// The binary form of a model in text form, number by number: whether they make a model is for
// ParseColmapModel to say. At most six times as long as the text. INVALID_ARGUMENT, naming file and
// line, if a line does not have the numbers that its kind has.
absl::StatusOr<ColmapBytes> BinaryFromText(std::string_view cameras_txt,
                                           std::string_view images_txt, std::string_view points_txt,
                                           std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_COLMAP_TEXT_H_
