#include "engine/target/black_lift.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "engine/core/check.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/bisect.h"
#include "engine/target/float_image.h"

namespace litags {
namespace {

constexpr double kDarkest = 0.02;      // share of the samples. Choice
constexpr int kWindow = 7;             // px, that brightness is the mean of. Choice
constexpr double kMeanOfBlack = 0.45;  // of n; g(0) = 0.399 n, the darkest windows less. Choice
// A JPEG leaves about half of the noise's deviation; of what is not compressed, kMeanOfBlack is the
// tighter bound. Choice
constexpr double kHidden = 1.6;
constexpr double kBright = 20;  // deviations: what lies there is not lifted

double Density(double t) { return std::exp(-t * t / 2) / std::sqrt(2 * std::numbers::pi); }
double Share(double t) { return std::erfc(-t / std::numbers::sqrt2) / 2; }

// Mean and deviation of max(0, t + noise), noise of deviation 1.
double LiftedMean(double t) { return t * Share(t) + Density(t); }
double LiftedDeviation(double t) {
  const double mean = LiftedMean(t);
  return std::sqrt(std::max(0.0, (t * t + 1) * Share(t) + t * Density(t) - mean * mean));
}

// The inverse of LiftedMean, at least 0.
double TrueMean(double mean) {
  if (mean >= kBright) return mean;
  return mean <= LiftedMean(0) ? 0 : Bisect(LiftedMean, mean, 0, kBright);
}

// Samples by the root of their brightness: many photos are sorted in little memory.
struct Level {
  int64_t samples = 0;
  double light = 0;    // sum
  double squares = 0;  // of the noise, sum
};
constexpr int kLevels = 1024;
using Levels = std::vector<Level>;

Levels LevelsOf(const Photo& photo, double gain, const PlaneU8& mask) {
  const FloatImage light = gain * LinearImage(photo);
  FloatImage mean;
  cv::blur(light, mean, cv::Size(kWindow, kWindow), cv::Point(-1, -1), cv::BORDER_REPLICATE);
  Levels levels(kLevels);
  for (int y = 1; y + 1 < light.rows; ++y) {
    for (int x = 1; x + 1 < light.cols; ++x) {
      if (!Counts(mask, x, y)) continue;
      const cv::Vec3f around =
          0.25f * (light(y, x - 1) + light(y, x + 1) + light(y - 1, x) + light(y + 1, x));
      for (int c = 0; c < 3; ++c) {
        const float difference = light(y, x)[c] - around[c];
        const float root = std::sqrt(std::clamp(mean(y, x)[c], 0.0f, 1.0f));
        Level& level = levels[static_cast<int>((kLevels - 1) * root)];
        level.samples += 1;
        level.light += mean(y, x)[c];
        level.squares += difference * difference / 1.25;  // that of a mean of four is in it
      }
    }
  }
  return levels;
}

void Add(const Level& from, Level* to) {
  to->samples += from.samples;
  to->light += from.light;
  to->squares += from.squares;
}

Level Darkest(const Levels& levels) {
  int64_t samples = 0;
  for (const Level& level : levels) samples += level.samples;
  Level sum;
  for (const Level& level : levels) {
    if (sum.samples > 0 && sum.samples >= kDarkest * samples) break;
    Add(level, &sum);
  }
  return sum;
}

}  // namespace

double NoiseAtBlack(absl::Span<const Photo> photos, absl::Span<const double> gains, int threads,
                    absl::Span<const PlaneU8> masks, double noise_kept) {
  LITAGS_CHECK(photos.size() == gains.size() && noise_kept > 0);
  std::vector<Levels> of_photos(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    of_photos[i] = LevelsOf(photos[i], gains[i], MaskOf(masks, i));
  });
  Levels levels(kLevels);
  for (const Levels& of_photo : of_photos) {
    for (int i = 0; i < kLevels; ++i) Add(of_photo[i], &levels[i]);
  }
  const Level darkest = Darkest(levels);
  if (darkest.light <= 0) return 0;  // nothing, or black without noise
  const double mean = darkest.light / darkest.samples;
  const double deviation = kHidden / noise_kept * std::sqrt(darkest.squares / darkest.samples);
  const auto deviation_of = [mean](double noise) {
    return noise * LiftedDeviation(TrueMean(mean / noise));
  };
  const double most = mean / kMeanOfBlack;
  return deviation_of(most) <= deviation ? most
                                         : Bisect(deviation_of, deviation, 1e-9 * most, most);
}

double WithoutLift(double light, double noise) {
  return noise > 0 ? noise * TrueMean(light / noise) : light;
}

}  // namespace litags
