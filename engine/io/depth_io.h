// Depth maps (and any float plane) as files: PFM, NPY, 16-bit PNG.
#ifndef LITAGS_ENGINE_IO_DEPTH_IO_H_
#define LITAGS_ENGINE_IO_DEPTH_IO_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/image.h"
#include "engine/io/image_io.h"

namespace litags {

// Reads a map as [1, H, W], by what the file is, not by its name: .pfm (one channel), .npy ([H, W],
// [1, H, W] or [H, W, 1]) or .png (one channel of 16 bits; values are the codes). Values that
// are not finite or beyond +-1e9 become NaN: no measurement. INVALID_ARGUMENT if it is none of
// these, broken, larger than `limits` (which fuzzing makes small), or has no other value.
absl::StatusOr<Planes> ReadDepthMap(const std::string& path, std::string_view field);
absl::StatusOr<Planes> DecodeDepthMap(std::string_view bytes, std::string_view field,
                                      const ImageLimits& limits = {});

// The map's size, px, by the file's first bytes. Errors of ReadDepthMap that these tell.
struct DepthSize {
  int width = 0, height = 0;
  int64_t pixels() const { return int64_t{width} * height; }
};
absl::StatusOr<DepthSize> ReadDepthSize(const std::string& path, std::string_view field);
absl::StatusOr<DepthSize> ParseDepthSize(std::string_view bytes, std::string_view field);

// The first of the photo's DepthMapNames() that exists in `dir`, with it. Empty if none.
std::string FindDepthMap(const std::string& dir, const std::string& photo);

// 1 or 3 planes as little-endian PFM (rows bottom to top, as the format wants).
std::string EncodePfm(const Planes& planes);
absl::Status WritePfm(const std::string& path, const Planes& planes);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_DEPTH_IO_H_
