#ifndef LITAGS_ENGINE_TRAIN_FIT_CAMERA_H_
#define LITAGS_ENGINE_TRAIN_FIT_CAMERA_H_

#include "engine/core/camera.h"
#include "engine/train/model.h"
#include "engine/train/options.h"
#include "engine/train/train_view.h"

namespace litags {

// Where a photo that `model` was not trained on was taken, from where view.view.camera says it was:
// the pose of the least loss that training would have, with the scene as it is. `options` are those
// of the training; `extent`: of the scene, its units. The given camera if a number is not finite.
Camera FitCamera(const TrainOptions& options, const Model& model, const TrainView& view,
                 double extent);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_FIT_CAMERA_H_
