// The surface that one view sees, from the photos of its neighbours.
#ifndef LITAGS_ENGINE_STEREO_SURFACE_H_
#define LITAGS_ENGINE_STEREO_SURFACE_H_

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/image.h"
#include "engine/stereo/match_image.h"
#include "engine/stereo/view_plan.h"

namespace litags {

struct SurfaceOptions {
  int radius = 2;             // of the correlated windows, px
  int best_sources = 2;       // a pixel is judged by so many sources, the best: others are occluded
  double step_px = 1.0;       // between neighbouring depths, in the source that sees them farthest
  int max_labels = 192;       // depths tried; more than this and the step grows
  double step_penalty = 0.1;  // of semi-global matching, in units of correlation
  double jump_penalty = 2.0;
  double edge_contrast = 0.1;  // of MatchImage::gray, halves jump_penalty
  double anchor_weight = 0.5;  // cost of leaving the depth of a sparse point at its pixel

  absl::Status Validate() const;
};

struct Surface {
  Planes inverse_depth;  // [1, h, w], > 0
  Planes fit;            // [1, h, w] correlation with the sources there, [-1, 1]
};

// Plane sweep over the depths of `plan`, semi-global matching, then two sweeps around the surface
// found, whose windows follow it. `plan` is in pixels of `reference`. CANCELLED on request.
absl::StatusOr<Surface> EstimateSurface(const MatchImage& reference,
                                        absl::Span<const MatchImage* const> sources,
                                        const ViewPlan& plan, const SurfaceOptions& options,
                                        const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_SURFACE_H_
