// Flicker of a method along a path through its scene's cameras.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_PATH_FLICKER_H_
#define LITAGS_ENGINE_TOOLS_TABLE_PATH_FLICKER_H_

#include "absl/status/statusor.h"
#include "engine/enhance/enhance.h"
#include "engine/eval/flicker.h"
#include "engine/pipeline/scene.h"

namespace litags {

struct PathFlicker {
  Flicker steps;
  double contrast = 0;  // standard deviation of a frame's codes, mean over frames
};

// Renders `frames` (2 or more) pictures along a path through the scene's cameras in order of name,
// each enhanced by `after` unless that is null, and compares each with the one before.
// FAILED_PRECONDITION (NO_PATH) with fewer than two cameras, or if no two frames show the same.
absl::StatusOr<PathFlicker> MeasurePathFlicker(const Scene& scene, int frames,
                                               const Enhancer* after, int threads);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_PATH_FLICKER_H_
