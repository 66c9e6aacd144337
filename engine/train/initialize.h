#ifndef LITAGS_ENGINE_TRAIN_INITIALIZE_H_
#define LITAGS_ENGINE_TRAIN_INITIALIZE_H_

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/splats.h"
#include "engine/io/sparse_model.h"
#include "engine/train/train_view.h"

namespace litags {

// Radius of the camera positions around their mean, times 1.1: the unit of learning rates and
// density thresholds (3DGS). At least 1e-6.
double SceneExtent(absl::Span<const TrainView> views);

// What a Gaussian is at first.
enum class StartShape {
  kBall,  // isotropic (3DGS)
  kDisk,  // where a point and its neighbours lie in a plane, a tenth as thick across it; else a
          // ball. For points of surfaces, such as stereo's. Choice
};

// Gaussians at sparse points (3DGS Sec. 5): scale = root mean squared distance to the three nearest
// neighbours, opacity 0.1, colour from the pseudo-targets of the photos that saw the point.
// `point_views[v]` is the index into `views` of the model's view v, -1 if it is not among them.
// LITA attributes start where the losses are flat: no noise, illumination = mean photo over mean
// target, d = mean depth over the cameras. FAILED_PRECONDITION with fewer than 4 points.
absl::StatusOr<Splats> InitializeFromPoints(absl::Span<const SparsePoint> points,
                                            absl::Span<const int> point_views,
                                            absl::Span<const TrainView> views, StartShape shape);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_INITIALIZE_H_
