#ifndef LITAGS_ENGINE_TRAIN_FIT_CAMERA_H_
#define LITAGS_ENGINE_TRAIN_FIT_CAMERA_H_

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/train/model.h"
#include "engine/train/options.h"
#include "engine/train/train_view.h"

namespace litags {

// Steps that FitCamera takes: as many as each of 67 photos has in 10,000 iterations. Choice
constexpr int kFitSteps = 150;

struct FittedCamera {
  Camera camera;
  bool finite = true;  // false: a gradient was not, and the camera is that of the step before
};

// Where a photo that `model` was not trained on was taken, from where view.view.camera says it was:
// the pose of the least loss that training would have, with the scene as it is. `options` are those
// of the training; `extent`: of the scene, its units. CANCELLED within a step.
absl::StatusOr<FittedCamera> FitCamera(const TrainOptions& options, const Model& model,
                                       const TrainView& view, double extent,
                                       const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_FIT_CAMERA_H_
