// A trained model as a file of another program.
#ifndef LITAGS_ENGINE_PIPELINE_EXPORT_SCENE_H_
#define LITAGS_ENGINE_PIPELINE_EXPORT_SCENE_H_

#include <array>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/export/viewer_scene.h"
#include "engine/train/model.h"

namespace litags {

// What the file is to hold: the model's Gaussians in the request's light, cropped, pruned, turned
// and scaled. `views` count from the model's origin; `up` is the scene's. Errors of
// Scene::Export.
absl::StatusOr<ViewerScene> MakeViewerScene(const Model& model, std::vector<View> views,
                                            const std::array<double, 3>& up,
                                            const ExportRequest& request);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_EXPORT_SCENE_H_
