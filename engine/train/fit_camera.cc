#include "engine/train/fit_camera.h"

#include <vector>

#include "engine/core/error.h"
#include "engine/render/renderer.h"
#include "engine/train/camera_pose.h"
#include "engine/train/objective.h"
#include "engine/train/pyramid.h"

namespace litags {

absl::StatusOr<FittedCamera> FitCamera(const TrainOptions& training, const Model& model,
                                       const TrainView& view, double extent,
                                       const CancelToken& cancel) {
  TrainOptions options = training;
  options.iterations = kFitSteps;
  const std::vector<TrainView> views(1, view);  // one copy: photos are large
  const ViewPyramid pyramid(&views, options);
  const Recipe& recipe = options.recipe;
  Objective objective(options);
  Renderer renderer;
  // R = R_0, as in the iterations that do not denoise.
  RenderSettings settings = objective.Settings(/*denoise=*/false);
  settings.sh_degree = model.sh_degree;
  settings.pose_grad = true;
  settings.lamp = view.lamp;
  Planes rendered, alpha, v_rendered;
  TrainView cropped;
  CameraPose pose(view.view.camera);
  for (int step = 0; step < kFitSteps; ++step) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    const TrainView& compared = pyramid.Compared(step, 0, step, &cropped, &settings.crop);
    renderer.Forward(model.splats, pose.Apply(compared.view.camera), settings, &rendered, &alpha);
    objective.Evaluate(compared, rendered, PdmWeights(), step, /*denoise=*/false, &v_rendered,
                       nullptr, pyramid.GridOf(step, 0).WeightOf(settings.crop));
    renderer.Backward(model.splats, v_rendered, Planes(), [](size_t, const float*, uint32_t) {});
    const double lr =
        FallingRate(recipe.lr_cameras, recipe.lr_cameras_final, double(step) / kFitSteps);
    if (!StepPose(renderer.pose_grad(), step + 1, lr, extent, AdamConstants(), &pose)) {
      return FittedCamera{pose.Apply(view.view.camera), /*finite=*/false};
    }
  }
  return FittedCamera{pose.Apply(view.view.camera)};
}

}  // namespace litags
