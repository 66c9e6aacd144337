// The scene on disk: what a snapshot holds, and the Scene that renders it.
#ifndef LITAGS_ENGINE_PIPELINE_SCENE_FILE_H_
#define LITAGS_ENGINE_PIPELINE_SCENE_FILE_H_

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/pipeline/scene.h"
#include "engine/train/model.h"

namespace litags {

// Where the cameras look, for orbits.
struct SceneFrame {
  std::array<double, 3> center = {0, 0, 0};
  std::array<double, 3> up = {0, -1, 0};
  double radius = 1;  // mean distance of the cameras from the centre
};

// Centre: the point nearest to all optical axes (least squares), or, where the axes are nearly
// parallel, a point in front of the mean camera. Up: mean of the cameras' up directions.
SceneFrame FrameOfViews(const std::vector<View>& views);

// Container of kind "scene", written atomically; the views count from model.origin. Reading: errors
// of Container::Read, and DATA_LOSS (SCENE_CORRUPT) if the parts do not fit together.
absl::Status SaveScene(const std::string& path, const Model& model, const std::vector<View>& views);
absl::StatusOr<std::shared_ptr<const Scene>> LoadSceneFile(const std::string& path);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SCENE_FILE_H_
