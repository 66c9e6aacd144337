// COLMAP's text model: cameras.txt, images.txt, points3D.txt.
#ifndef LITAGS_ENGINE_IO_COLMAP_TEXT_H_
#define LITAGS_ENGINE_IO_COLMAP_TEXT_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace litags {

// A file of a model.
enum class ColmapPart { kCameras, kImages, kPoints };

// The binary form of a file in text form, number by number: whether they make a model is for
// ParseColmapModel to say. At most six times as long as the text, and eight bytes.
// INVALID_ARGUMENT, naming the line, if one does not have the numbers that its kind has.
absl::StatusOr<std::string> BinaryFromText(ColmapPart part, std::string_view text,
                                           std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_COLMAP_TEXT_H_
