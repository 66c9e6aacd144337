// What several views agree on: one view's depth map, checked and averaged with its neighbours'.
#ifndef LITAGS_ENGINE_STEREO_AGREEMENT_H_
#define LITAGS_ENGINE_STEREO_AGREEMENT_H_

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/depth/depth_provider.h"
#include "engine/stereo/surface.h"

namespace litags {

struct AgreementOptions {
  double tolerance = 0.02;  // of depth, within which two views agree
  double least_fit = 0.2;   // correlation that counts for nothing; confidence grows to 1 at
  double full_fit = 0.7;    // this one
  int full_views = 2;       // and with the views that agree; fewer share proportionally
};

// A view with its surface; both are of the working size.
struct ViewSurface {
  const Camera* camera = nullptr;
  const Surface* surface = nullptr;
};

// Depth [1, h, w] of the view, the mean of its own and those of the other views that see the same
// surface point; confidence 0, and depth 0, where no other view agrees.
DepthMap Agree(const ViewSurface& view, absl::Span<const ViewSurface> others,
               const AgreementOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_AGREEMENT_H_
