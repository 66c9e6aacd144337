#ifndef LITAGS_ENGINE_PIPELINE_MODEL_SCENE_H_
#define LITAGS_ENGINE_PIPELINE_MODEL_SCENE_H_

#include <memory>
#include <vector>

#include "engine/core/camera.h"
#include "engine/pipeline/scene.h"
#include "engine/train/model.h"

namespace litags {

// The Scene of a model in memory; the views count from model.origin.
std::shared_ptr<const Scene> MakeScene(Model model, std::vector<View> views);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_MODEL_SCENE_H_
