#include "engine/noise/noise_estimate.h"

#include <gtest/gtest.h>

#include <vector>

#include "engine/noise/two_halves_test_util.h"

namespace litags {
namespace {

constexpr int kSize = kTwoHalvesSize;

PlaneU8 LeftHalf() {
  PlaneU8 mask(kSize, kSize);
  for (int i = 0; i < kSize * kSize; ++i) mask.data[i] = i % kSize < kSize / 2 ? kCounts : 0;
  return mask;
}

TEST(NoiseEstimate, IsTheDeviationOfFlatAreasThatAreNeitherBlackNorWhite) {
  EXPECT_EQ(NoiseEstimate().Deviation(), 0);
  EXPECT_NEAR(NoiseOf(TwoHalves(60, 180, 8, 8), {}).Deviation(), 8, 0.8);
  EXPECT_LT(NoiseOf(TwoHalves(60, 180), {}).Deviation(), 0.5);
  EXPECT_NEAR(NoiseOf(TwoHalves(0, 180, 0, 8), {}).Deviation(), 8, 0.8);
  EXPECT_NEAR(NoiseOf(TwoHalves(255, 180, 0, 8), {}).Deviation(), 8, 0.8);
  EXPECT_NEAR(NoiseOf(TwoHalves(60, 180, 4, 20), LeftHalf()).Deviation(), 4, 0.4);
}

TEST(NoiseEstimate, OfSeveralPicturesIsThatOfAllTheirPixels) {
  const NoiseEstimate one = NoiseOf(TwoHalves(60, 60, 4, 4), {});
  const NoiseEstimate two = NoiseOf(TwoHalves(60, 60, 8, 8), {});
  NoiseEstimate all;
  all.Add(one);
  all.Add(two);
  EXPECT_GT(all.Deviation(), one.Deviation());
  EXPECT_LT(all.Deviation(), two.Deviation());
}

TEST(NoiseEstimate, HugeDifferencesAreCountedToo) {
  NoiseEstimate noise;
  for (int i = 0; i < 4; ++i) noise.AddDifference(1e6f);
  EXPECT_GT(noise.Deviation(), 255);
}

TEST(NoiseOfChannel, IsThatOfItsSamplesUpToALevel) {
  const Photo photo = TwoHalves(60, 180, 4, 20);
  std::vector<float> green(photo.pixels());
  for (size_t i = 0; i < green.size(); ++i) green[i] = EncodedOf(photo.data[3 * i + 1]);
  const auto noise = [&](const PlaneU8& mask, float most) {
    return NoiseOfChannel(green.data(), kSize, kSize, mask, most).Deviation();
  };
  EXPECT_NEAR(noise(LeftHalf(), 1), 4, 0.5);
  EXPECT_NEAR(noise({}, 100 / 255.0f), 4, 0.5);
  EXPECT_GT(noise({}, 1), 5);
  EXPECT_EQ(noise({}, 0), 0) << "black says nothing";
}

}  // namespace
}  // namespace litags
