// Tells a photo of something from one of nothing but noise.
#ifndef LITAGS_ENGINE_PIPELINE_PHOTO_STRUCTURE_H_
#define LITAGS_ENGINE_PIPELINE_PHOTO_STRUCTURE_H_

#include "engine/core/photo.h"

namespace litags {

// The largest correlation, by its size in [0, 1], between means of neighbouring blocks, over block
// sizes and over the two directions. 1 for photos of too few pixels, or of one colour.
double StructureOf(const Photo& photo);

// Below it there is nothing but noise.
//
// Theory: blocks of white noise correlate by 0 +- 1 / sqrt(pairs), 0.06 at most, which is a quarter
// of this; noise that a camera smoothed over s px adds some s / (2 block). A scene whose block
// means vary by v about noise of variance n gives r v / (v + n), r being that of its light: to fall
// below, v must be a third of n, of noise that is the mean of 16 x 16 x 3 samples.
constexpr double kNoStructure = 0.25;

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PHOTO_STRUCTURE_H_
