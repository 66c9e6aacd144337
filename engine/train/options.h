#ifndef LITAGS_ENGINE_TRAIN_OPTIONS_H_
#define LITAGS_ENGINE_TRAIN_OPTIONS_H_

#include <cstdint>

#include "engine/render/renderer.h"
#include "engine/train/recipe.h"

namespace litags {

// Everything that decides the result of a training run, besides the data.
struct TrainOptions {
  Recipe recipe = LitagsPaper();
  int iterations = 15000;  // one photo each; paper
  uint64_t seed = 0;
  int threads = 0;    // 0: all cores; never changes the result
  int sh_degree = 3;  // 0..3
  int64_t max_gaussians = 200000;
  float near_plane = RenderSettings().near_plane;
  bool refine_cameras = false;  // poses are learnt, too; else they stay as given
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_OPTIONS_H_
