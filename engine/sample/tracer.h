// Pictures and exact depth of a World.
#ifndef LITAGS_ENGINE_SAMPLE_TRACER_H_
#define LITAGS_ENGINE_SAMPLE_TRACER_H_

#include <array>
#include <cstdint>
#include <functional>
#include <optional>

#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/sample/world.h"

namespace litags::sample {

struct TraceOptions {
  int grid = 3;  // grid x grid stratified samples a pixel
  uint64_t seed = 0;
  int threads = 0;  // <= 0: all cores; the result does not depend on it
  // Direction that the image point (x, y), px, looks along, in the camera frame; nullopt: it is
  // black. Without it the camera is a pinhole.
  std::function<std::optional<std::array<double, 3>>(double x, double y)> lens = nullptr;
};

// Radiance, linear light, [3, H, W]. Direct light with soft shadows, occluded ambient light, one
// Fresnel reflection. Box-filtered over each pixel.
Planes TraceRadiance(const World& world, const Camera& camera, const TraceOptions& options);

// Distance along the optical axis (z of the camera frame) at each pixel's centre, metres,
// [1, H, W]; 0 where nothing is hit.
Planes TraceDepth(const World& world, const Camera& camera, int threads);

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_TRACER_H_
