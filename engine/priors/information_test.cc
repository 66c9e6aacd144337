#include "engine/priors/information.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/core/mask.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr int kSize = 120;

bool IsLeft(size_t sample) { return (sample / 3) % kSize < kSize / 2; }

// Left half of code `left`, right half of code `right`, with normal noise of such deviations.
ImageU8 TwoHalves(double left, double right, double left_noise = 0, double right_noise = 0) {
  const CounterRng rng(7, 1);
  ImageU8 image(kSize, kSize);
  for (size_t i = 0; i < image.data.size(); ++i) {
    const double code =
        IsLeft(i) ? left + left_noise * rng.Normal(i) : right + right_noise * rng.Normal(i);
    image.data[i] = static_cast<uint8_t>(std::clamp(std::round(code), 0.0, 255.0));
  }
  return image;
}

TEST(TargetNoise, IsTheDeviationOfFlatAreas) {
  const ImageU8 photo = TwoHalves(20, 90), target = TwoHalves(60, 180, 12, 4);
  const auto noise = TargetNoise({&photo}, {&target});
  EXPECT_NEAR(noise[20], 12, 1.2);
  EXPECT_NEAR(noise[90], 4, 0.4);
}

TEST(TargetNoise, KnowsWhatRoundingTookAway) {
  // Codes 3, 4 and 5 in broad stripes; a step of one is a step of ten in the target.
  ImageU8 photo(kSize, kSize), target(kSize, kSize);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = static_cast<uint8_t>(3 + (i / 3) % kSize / 40);
    target.data[i] = static_cast<uint8_t>(10 * photo.data[i]);
  }
  EXPECT_NEAR(TargetNoise({&photo}, {&target})[4], 10 / std::sqrt(12.0), 1e-6);
}

TEST(TargetNoise, ClippedHighlightsAreGuesses) {
  const ImageU8 photo = TwoHalves(100, 255), target = TwoHalves(50, 200);
  const auto noise = TargetNoise({&photo}, {&target});
  EXPECT_LT(noise[100], 1);
  EXPECT_EQ(noise[kClippedCode], kClippedNoise);
  EXPECT_EQ(noise[255], kClippedNoise);
}

TEST(PictureNoise, IsTheDeviationOfFlatAreasThatAreNotBlack) {
  const auto of = [](const ImageU8& picture, const PlaneU8& mask = {}) {
    PictureNoise noise;
    noise.Add(picture, mask);
    return noise.Deviation();
  };
  EXPECT_EQ(PictureNoise().Deviation(), 0);
  EXPECT_NEAR(of(TwoHalves(60, 180, 8, 8)), 8, 0.8);
  EXPECT_LT(of(TwoHalves(60, 180)), 0.5);
  EXPECT_NEAR(of(TwoHalves(0, 180, 0, 8)), 8, 0.8);
  PlaneU8 left(kSize, kSize);
  for (int i = 0; i < kSize * kSize; ++i) left.data[i] = i % kSize < kSize / 2 ? kCounts : 0;
  EXPECT_NEAR(of(TwoHalves(60, 180, 4, 20), left), 4, 0.4);
}

TEST(PictureNoise, OfSeveralPicturesIsThatOfAllTheirPixels) {
  PictureNoise all, one, two;
  one.Add(TwoHalves(60, 60, 4, 4), {});
  two.Add(TwoHalves(60, 60, 8, 8), {});
  all.Add(one);
  all.Add(two);
  EXPECT_GT(all.Deviation(), one.Deviation());
  EXPECT_LT(all.Deviation(), two.Deviation());
}

TEST(InformationWeights, FavourWhatIsKnownAndHaveAMeanOfOne) {
  const ImageU8 clipped = TwoHalves(100, 255), clear = TwoHalves(100, 100);
  const ImageU8 target = TwoHalves(50, 200), clear_target = TwoHalves(50, 50);
  const auto planes = InformationWeights({&clipped, &clear}, {&target, &clear_target});
  ASSERT_EQ(planes.size(), 2u);
  double sum = 0;
  for (const PlaneU8& plane : planes) {
    sum += std::accumulate(plane.data.begin(), plane.data.end(), 0.0);
  }
  EXPECT_NEAR(sum / (2 * kSize * kSize) / kInformationOne, 1, 0.02);
  // 1 / (1 + (48 / 24)^2) of the weight of a pixel without noise, in steps of 1 / 80.
  EXPECT_NEAR(planes[0].data[kSize - 1] / double(planes[0].data[0]), 0.2, 0.01);
  EXPECT_EQ(planes[0].data[0], planes[1].data[kSize - 1]);
}

TEST(InformationWeights, AreEqualWhereAllPixelsAre) {
  const ImageU8 photo = TwoHalves(100, 100);
  const std::vector<PlaneU8> planes = InformationWeights({&photo}, {&photo});
  for (const uint8_t weight : planes[0].data) ASSERT_EQ(weight, kInformationOne);
  EXPECT_TRUE(InformationWeights({}, {}).empty());
}

}  // namespace
}  // namespace litags
