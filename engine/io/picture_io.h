// Pictures as PNG and JPEG. Colours are sRGB-encoded.
#ifndef LITAGS_ENGINE_IO_PICTURE_IO_H_
#define LITAGS_ENGINE_IO_PICTURE_IO_H_

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

// Encodes. `quality` in [1, 100]. INVALID_ARGUMENT for an empty image.
absl::StatusOr<std::string> EncodePng(const ImageU8& image);
absl::StatusOr<std::string> EncodeJpeg(const ImageU8& image, int quality = 95);
// One channel, 16 bits: round(plane * scale), clamped to [0, 65535]; NaN becomes 0.
// INVALID_ARGUMENT for several planes.
absl::StatusOr<std::string> EncodePng16(const Planes& plane, double scale = 65535.0);

// Encode and write atomically.
absl::Status WritePng(const std::string& path, const ImageU8& image);
absl::Status WriteJpeg(const std::string& path, const ImageU8& image, int quality = 95);
absl::Status WritePng16(const std::string& path, const Planes& plane);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_PICTURE_IO_H_
