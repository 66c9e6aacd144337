// What several views agree on: one view's depth map, checked and averaged with its neighbours'.
#ifndef LITAGS_ENGINE_STEREO_AGREEMENT_H_
#define LITAGS_ENGINE_STEREO_AGREEMENT_H_

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/depth/depth_provider.h"
#include "engine/stereo/surface.h"

namespace litags {

// A view with its surface; both are of the working size.
struct ViewSurface {
  const Camera* camera = nullptr;
  const Surface* surface = nullptr;
};

// Depth [1, h, w] of the view, the mean of its own and those of the other views that see the same
// surface point; confidence 0, and depth 0, where no other view agrees.
DepthMap Agree(const ViewSurface& view, absl::Span<const ViewSurface> others);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_AGREEMENT_H_
