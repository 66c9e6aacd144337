// Gaussians as .ply, in the layout every splat viewer opens.
#ifndef LITAGS_ENGINE_IO_PLY_H_
#define LITAGS_ENGINE_IO_PLY_H_

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/splats.h"

namespace litags {

// Binary little-endian floats, stored (not activated) parameters: x y z nx ny nz f_dc_0..2
// f_rest_0..44 (all red, then green, then blue) opacity scale_0..2 rot_0..3 (wxyz). Normals are 0.
// With `lita_attributes` these follow: structure depth noise_0..2 illumination_0..2. An `origin`
// that positions count from stands in a comment, "origin X Y Z".
std::string EncodePly(const Splats& splats, bool lita_attributes,
                      const std::array<double, 3>& origin = {});
absl::Status WritePly(const std::string& path, const Splats& splats, bool lita_attributes,
                      const std::array<double, 3>& origin = {});

struct PlyScene {
  Splats splats;
  int sh_degree = 0;             // of the file: 0, 9, 24 or 45 f_rest properties
  bool lita_attributes = false;  // rows of LITA attributes are zero without
};

// Reads such files, properties in any order; scalar properties it does not know are skipped.
// `field` starts every message. INVALID_ARGUMENT: NOT_A_PLY, PLY_UNSUPPORTED (ASCII, lists, points
// that are no Gaussians), PLY_TRUNCATED, PLY_TOO_LARGE, NOT_FINITE.
absl::StatusOr<PlyScene> DecodePly(std::string_view bytes, std::string_view field,
                                   int64_t max_gaussians = 20'000'000);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_PLY_H_
