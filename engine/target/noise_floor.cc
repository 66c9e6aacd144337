#include "engine/target/noise_floor.h"

#include <algorithm>
#include <cmath>

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

}  // namespace

bool NoiseLevels::Level::IsNoise() const {
  const auto n = static_cast<double>(channels);
  return mean / n <= kMostOfDeviation * std::sqrt(variance / n);
}

NoiseLevels::NoiseLevels() : levels_(kLevels) {}

NoiseLevels::NoiseLevels(const Photo& photo, const PlaneU8& mask) : NoiseLevels() {
  ForLightSquares(photo, mask, [&](const LightSquare& square) {
    const double level = std::max(0.0, square.LargestMean() / LightOfLevel());
    if (square.counted < kLeastCounted || level >= kLevels) return;
    Level& of = levels_[static_cast<size_t>(level)];
    for (int c = 0; c < 3; ++c) {
      ++of.channels;
      of.mean += square.mean[c];
      of.variance += square.variance[c];
    }
  });
}

void NoiseLevels::Add(const NoiseLevels& other) {
  for (int i = 0; i < kLevels; ++i) {
    levels_[i].channels += other.levels_[i].channels;
    levels_[i].mean += other.levels_[i].mean;
    levels_[i].variance += other.levels_[i].variance;
  }
}

double NoiseLevels::Floor() const {
  int floor = 0;
  for (int i = 0; i < kLevels; ++i) {
    if (levels_[i].channels == 0) continue;
    if (!levels_[i].IsNoise()) break;
    floor = i + 1;
  }
  return floor * LightOfLevel();
}

double NoiseLevels::Variance() const {
  double variance = 0;
  int64_t channels = 0;
  for (const Level& level : levels_) {
    variance += level.variance;
    channels += level.channels;
  }
  return channels > 0 ? variance / static_cast<double>(channels) : 0;
}

double NoiseFloor(absl::Span<const Photo> photos, int threads, absl::Span<const PlaneU8> masks) {
  std::vector<NoiseLevels> of_photos(photos.size());
  ParallelFor(threads, photos.size(),
              [&](size_t i, int) { of_photos[i] = NoiseLevels(photos[i], MaskOf(masks, i)); });
  NoiseLevels all;
  for (const NoiseLevels& of_photo : of_photos) all.Add(of_photo);
  return all.Floor();
}

}  // namespace litags
