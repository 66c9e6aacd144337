#include "engine/target/noise_floor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

// Light of `codes` below the toe of sRGB, where codes are in proportion to light.
double Light(double codes) { return LinearFromSrgb(codes / 255); }

// A photo of one light with the noise of a sensor; both in codes.
Photo NoisyPhoto(double light, double noise, int seed) {
  ImageU8 photo(160, 120);
  const CounterRng rng(seed, 0);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = static_cast<uint8_t>(std::lround(std::max(0.0, light + noise * rng.Normal(i))));
  }
  return PhotoFromU8(photo);
}

TEST(NoiseFloor, CoversWhatNoiseMakesOfBlack) {
  for (const double noise : {0.7, 1.0, 2.0}) {
    const std::vector<Photo> photos = {NoisyPhoto(0, noise, 1), NoisyPhoto(0, noise, 2)};
    const double floor = NoiseFloor(photos, 2);
    // The mean and three deviations of it.
    EXPECT_GT(floor, Light((0.4 + 3 * 0.15) * noise)) << noise;
    EXPECT_LT(floor, Light(2 * noise)) << noise;
    EXPECT_EQ(floor, NoiseFloor(photos, 1));
  }
}

TEST(NoiseFloor, IsBelowWhatIsBrighterThanItsNoise) {
  const double floor = NoiseFloor({NoisyPhoto(0, 1, 1), NoisyPhoto(4, 1, 2)}, 1);
  EXPECT_GT(floor, Light(0.9));
  EXPECT_LT(floor, Light(2.5));
  EXPECT_LT(NoiseFloor({NoisyPhoto(2, 1, 1)}, 1), Light(1.5));
  EXPECT_EQ(NoiseFloor({NoisyPhoto(20, 1, 1)}, 1), 0);
}

// Of a photo that was shrunk there is nothing left to tell it by.
TEST(NoiseLevels, AddUpToTheFloorOfAllPhotos) {
  const std::vector<Photo> photos = {NoisyPhoto(0, 1, 1), NoisyPhoto(4, 1, 2)};
  NoiseLevels sum;
  for (const Photo& photo : photos) sum.Add(NoiseLevels(photo, {}));
  EXPECT_EQ(sum.Floor(), NoiseFloor(photos, 1));
  // A code's light, squared; black cuts some of one photo's off.
  const double variance = Light(1) * Light(1);
  EXPECT_GT(sum.Variance(), 0.5 * variance);
  EXPECT_LT(sum.Variance(), 1.1 * variance);
  EXPECT_EQ(NoiseLevels().Floor(), 0);
  EXPECT_EQ(NoiseLevels().Variance(), 0);
}

}  // namespace
}  // namespace litags
