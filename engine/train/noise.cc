#include "engine/train/noise.h"

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/noise/noise_estimate.h"
#include "engine/train/pyramid.h"

namespace litags {
namespace {

// Codes of 255. Choices
constexpr double kDropoutNoise = 2;  // of fine noise, to half of the dropout
constexpr double kWhiteNoise = 4;    // of white noise, that training begins to follow

}  // namespace

TargetNoise MeasureNoise(const std::vector<TrainView>& views, int threads) {
  std::vector<NoiseEstimate> full(views.size()), half(views.size());
  ParallelFor(threads, views.size(), [&](size_t i, int) {
    full[i] = NoiseOf(views[i].target, views[i].mask);
    half[i] = NoiseOf(HalfPhoto(views[i].target), HalfMask(views[i].mask));
  });
  const auto deviation = [](const std::vector<NoiseEstimate>& noises) {
    NoiseEstimate all;
    for (const NoiseEstimate& noise : noises) all.Add(noise);
    return all.Deviation();
  };
  const double fine = deviation(full), coarse = deviation(half);
  return {fine, std::sqrt(std::max(0.0, (fine * fine - coarse * coarse) * 4 / 3))};
}

Recipe AdaptToNoise(Recipe recipe, const TargetNoise& noise) {
  if (!recipe.lita) return recipe;
  const double fine = noise.fine * noise.fine, white = noise.white * noise.white;
  const double more = 1 + white / (white + kWhiteNoise * kWhiteNoise);
  const double dropout = recipe.dropout * more * fine / (fine + kDropoutNoise * kDropoutNoise);
  recipe.dropout = std::min(dropout, kMaxDropout);
  recipe.exposure_ssim *= kWhiteNoise / std::max(kWhiteNoise, noise.white);
  return recipe;
}

}  // namespace litags
