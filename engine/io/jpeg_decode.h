// Inside this module: JPEG decoding with the precision that the file has.
#ifndef LITAGS_ENGINE_IO_JPEG_DECODE_H_
#define LITAGS_ENGINE_IO_JPEG_DECODE_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "engine/core/photo.h"
#include "engine/io/image_io.h"

namespace litags {

// Decodes to RGB as stored (not turned upright), from the coefficients: dequantised, inverse DCT in
// floating point, chroma interpolated linearly between its (centred) samples, YCbCr to RGB as in
// JFIF. Nothing is rounded to 8 bits or clipped at black, as libjpeg's own output is: a dark JPEG
// holds more than 8 bits. Errors of JpegCoefficients::Read.
absl::StatusOr<Photo> DecodeJpeg(std::string_view bytes, const ImageInfo& info,
                                 std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_JPEG_DECODE_H_
