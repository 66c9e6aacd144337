// Scenes for viewers that draw small Gaussians as 3DGS does, or similarly.
#ifndef LITAGS_ENGINE_PIPELINE_VIEWER_SPLATS_H_
#define LITAGS_ENGINE_PIPELINE_VIEWER_SPLATS_H_

#include <vector>

#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/splats.h"
#include "engine/render/renderer.h"

namespace litags {

// Gaussians as viewers should get them that add `added` px^2 to the 2D covariance and leave the
// opacity (kEps2d: PixelFilter::kDilate), to draw much the same in pictures of the size of `views`.
// With p the size of a pixel at the Gaussian, in scene units, mean over the views that see it, and
// eps what `trained` adds, kMipEps2d or kEps2d, scales s become s':
//   s'^2 = s^2 - (added - eps) p^2, where that is more than (0.1 p)^2, else that
// With kMip the opacity o becomes o':
//   o' = o sqrt(product of s^2 / (s'^2 + added p^2)) over the two larger scales,
// exact for large Gaussians seen along their shortest axis, and nearly so for small ones. Those
// that no view sees stay as they are, and so do those left once the token is raised. `threads` <=
// 0: all cores.
Splats SplatsForViewers(const std::vector<View>& views, PixelFilter trained, float added,
                        Splats splats, int threads = 0, const CancelToken& cancel = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_VIEWER_SPLATS_H_
