// What the noise of the photos asks of training.
#ifndef LITAGS_ENGINE_TRAIN_NOISE_H_
#define LITAGS_ENGINE_TRAIN_NOISE_H_

#include <vector>

#include "engine/train/recipe.h"
#include "engine/train/train_view.h"

namespace litags {

// Noise of all targets of a capture, standard deviations, codes of 255.
struct TargetNoise {
  // Of what differs from pixel to pixel (engine/noise): noise, and fine texture all over.
  double fine = 0;
  // Of noise that every pixel has for itself, which is half as much in pictures of half the size,
  // where texture is as much: sqrt(4/3 (fine^2 - the same there^2)). Less than there is where
  // rounding hides it, or a camera has smoothed it.
  double white = 0;
};

// threads <= 0: all cores.
TargetNoise MeasureNoise(const std::vector<TrainView>& views, int threads);

// The recipe as targets with such noise want it. Dropout times s^2 / (s^2 + 2^2) with s codes of
// fine noise, and times 1 + w^2 / (w^2 + 4^2) with w of white noise, at most kMaxDropout.
// exposure_ssim falls in proportion beyond 4 codes of white noise, whose structure SSIM would ask
// for as for that of the scene. Plain 3DGS stays as it is. Choice, measured
Recipe AdaptToNoise(Recipe recipe, const TargetNoise& noise);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_NOISE_H_
