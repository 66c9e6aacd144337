#include "engine/target/noise_floor.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/light_squares.h"

namespace litags {
namespace {

// Mean of what is noise, in deviations: 0.68 where no light fell, 0.78 where light is a fifth of
// the noise. Measured, docs/experiments/exposure.md: less misses noise of a torch's dark photos,
// more takes the shadows of dark photos for noise.
constexpr double kMostOfDeviation = 0.8;
constexpr int kLeastCounted = kSquare * kSquare / 2;  // pixels that tell a square's variance

constexpr int kLevelsPerCode = 16, kLevels = 8 * kLevelsPerCode;  // of squares' largest means

double LightOfLevel() { return LinearTable::Get()(kPhotoCode) / kLevelsPerCode; }

// Squares of about the same light, sums over their channels.
struct Level {
  int64_t channels = 0;
  double mean = 0, variance = 0;

  bool IsNoise() const {
    const auto n = static_cast<double>(channels);
    return mean / n <= kMostOfDeviation * std::sqrt(variance / n);
  }
};
using Levels = std::vector<Level>;

Levels LevelsOf(const Photo& photo, const PlaneU8& mask) {
  Levels levels(kLevels);
  ForLightSquares(photo, mask, [&](const LightSquare& square) {
    const double level = std::max(0.0, square.LargestMean() / LightOfLevel());
    if (square.counted < kLeastCounted || level >= kLevels) return;
    Level& of = levels[static_cast<size_t>(level)];
    for (int c = 0; c < 3; ++c) {
      ++of.channels;
      of.mean += square.mean[c];
      of.variance += square.variance[c];
    }
  });
  return levels;
}

}  // namespace

double NoiseFloor(absl::Span<const Photo> photos, int threads, absl::Span<const PlaneU8> masks) {
  std::vector<Levels> of_photos(photos.size());
  ParallelFor(threads, photos.size(),
              [&](size_t i, int) { of_photos[i] = LevelsOf(photos[i], MaskOf(masks, i)); });
  int floor = 0;
  for (int i = 0; i < kLevels; ++i) {
    Level all;
    for (const Levels& levels : of_photos) {
      all.channels += levels[i].channels;
      all.mean += levels[i].mean;
      all.variance += levels[i].variance;
    }
    if (all.channels == 0) continue;
    if (!all.IsNoise()) break;
    floor = i + 1;
  }
  return floor * LightOfLevel();
}

}  // namespace litags
