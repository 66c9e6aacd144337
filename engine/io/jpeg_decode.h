// Inside this module: JPEG decoding by libjpeg.
#ifndef LITAGS_ENGINE_IO_JPEG_DECODE_H_
#define LITAGS_ENGINE_IO_JPEG_DECODE_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "engine/core/image.h"
#include "engine/io/image_io.h"

namespace litags {

// Decodes to RGB as stored (not turned upright). `info` is the checked header; libjpeg must find
// the same size in the file. A scan that ends early or cannot be decoded is an error, where libjpeg
// (and OpenCV with it) only warns and fills the rest with grey.
absl::StatusOr<ImageU8> DecodeJpegRgb(std::string_view bytes, const ImageInfo& info,
                                      std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_JPEG_DECODE_H_
