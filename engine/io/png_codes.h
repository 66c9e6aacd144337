// The codes of a PNG's pixels, read and written by libpng.
#ifndef LITAGS_ENGINE_IO_PNG_CODES_H_
#define LITAGS_ENGINE_IO_PNG_CODES_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

enum class PngChannels {
  kColor,  // RGB: grey is there three times, transparency is left out
  kAll,    // 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha
};

struct PngShape {
  int width = 0, height = 0;
  int channels = 0;
  int white = 0;  // the largest code: 255, also of files of fewer bits, or 65535
};

// Takes row y, [width, channels] codes. Palettes are expanded.
using TakePngRow = absl::FunctionRef<void(const PngShape& shape, int y, const uint16_t* codes)>;

// Reads the whole file, rows from top to bottom, with its checksums. The size is that of
// ParsePngHeader (image_header.h), whose limits the caller has checked. What the file says of
// colours is passed over. Errors: IMAGE_TRUNCATED; IMAGE_CORRUPT, perhaps after some rows.
absl::Status ReadPngCodes(std::string_view bytes, PngChannels channels, std::string_view field,
                          TakePngRow take_row);

enum class PngSpeed {
  kPicture,  // for pictures that are sent: neighbours' differences, runs
  kPhoto,    // for noisy photos of 16 bits: libpng's choice of filters
};

// A PNG of `codes`, [height, width, channels], of 1, 3 or 4 channels. Errors: IMAGE_EMPTY;
// IMAGE_ENCODE_FAILED, kInternal.
absl::StatusOr<std::string> EncodePngCodes(const uint8_t* codes, int width, int height,
                                           int channels);
absl::StatusOr<std::string> EncodePngCodes(const uint16_t* codes, int width, int height,
                                           int channels, PngSpeed speed = PngSpeed::kPicture);

// The PNG with one chunk more, before its image data.
std::string WithPngChunk(std::string png, const std::string& type, const std::string& data);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_PNG_CODES_H_
