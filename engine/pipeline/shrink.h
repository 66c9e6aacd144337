#ifndef LITAGS_ENGINE_PIPELINE_SHRINK_H_
#define LITAGS_ENGINE_PIPELINE_SHRINK_H_

#include "engine/train/train_view.h"

namespace litags {

// Camera, photo, and pseudo-target and mask where there are any, averaged down until the longer
// side is `max_side` px; smaller ones stay as they are, and all if it is 0. Of structure,
// information and depth there must be none yet: they are left alone.
void Shrink(int max_side, TrainView* v);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SHRINK_H_
