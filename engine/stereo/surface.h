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

struct Surface {
  Planes inverse_depth;  // [1, h, w], > 0
  Planes fit;            // [1, h, w] correlation with the sources there, [-1, 1]
};

// Plane sweep over the depths of `plan`, semi-global matching, then two sweeps around the surface
// found, whose windows follow it. `plan` is in pixels of `reference`. CANCELLED on request.
absl::StatusOr<Surface> EstimateSurface(const MatchImage& reference,
                                        absl::Span<const MatchImage* const> sources,
                                        const ViewPlan& plan, const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_SURFACE_H_
