// The renderer once more, as plainly as possible: double precision, every Gaussian against every
// pixel, no tiles, no SIMD. Tests compare the real one with it.
#ifndef LITAGS_ENGINE_RENDER_REFERENCE_RENDERER_H_
#define LITAGS_ENGINE_RENDER_REFERENCE_RENDERER_H_

#include <cstdint>
#include <vector>

#include "engine/core/camera.h"
#include "engine/core/splats.h"
#include "engine/render/renderer.h"

namespace litags {

// Row-major [N][kSplatRows] parameters in double.
std::vector<double> ToDoubles(const Splats& splats);

struct ReferenceImage {
  std::vector<double> image;  // [C, H, W]
  std::vector<double> alpha;  // [H, W]
  // [H, W]: 1 where a decision (alpha against 1/255 or 0.99, T against 1e-4) is within 0.1 % of its
  // threshold, so that single precision may decide otherwise.
  std::vector<char> fragile;
  int64_t contributions = 0;  // (pixel, Gaussian) pairs that were composited
};

// LITA-GS Eq. 1 and Eq. 8.
ReferenceImage RenderReference(const std::vector<double>& params, const Camera& camera,
                               const RenderSettings& settings);

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_REFERENCE_RENDERER_H_
