#include "engine/train/noise.h"

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/priors/information.h"
#include "engine/train/pyramid.h"

namespace litags {
namespace {

constexpr double kDropoutNoise = 2;  // codes of 255, to half of the dropout. Choice

}  // namespace

TargetNoise MeasureNoise(const std::vector<TrainView>& views, int threads) {
  std::vector<PictureNoise> full(views.size()), half(views.size());
  ParallelFor(threads, views.size(), [&](size_t i, int) {
    full[i].Add(views[i].target, views[i].mask);
    const TrainView small = HalfSize(views[i]);
    half[i].Add(small.target, small.mask);
  });
  const auto deviation = [](const std::vector<PictureNoise>& noises) {
    PictureNoise all;
    for (const PictureNoise& noise : noises) all.Add(noise);
    return all.Deviation();
  };
  const double fine = deviation(full), coarse = deviation(half);
  return {fine, std::sqrt(std::max(0.0, (fine * fine - coarse * coarse) * 4 / 3))};
}

TrainOptions SuitedTo(const TargetNoise& noise, TrainOptions options) {
  const double squared = noise.fine * noise.fine;
  options.dropout *= squared / (squared + kDropoutNoise * kDropoutNoise);
  if (options.ssim_noise > 0 && noise.white > options.ssim_noise) {
    options.exposure_ssim *= options.ssim_noise / noise.white;
  }
  return options;
}

}  // namespace litags
