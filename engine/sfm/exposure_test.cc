#include "engine/sfm/exposure.h"

#include <cmath>

#include "engine/core/rng.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

// Noise around `level`, so that blur and contrast have something to work on.
ImageU8 NoisyPhoto(int level, int amplitude) {
  ImageU8 photo(64, 48);
  const CounterRng rng(7, 0);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = static_cast<uint8_t>(level + rng.Below(i, 2 * amplitude + 1) - amplitude);
  }
  return photo;
}

double StandardDeviation(const ImageU8& photo) {
  double sum = 0, squares = 0;
  for (const uint8_t v : photo.data) {
    sum += v;
    squares += double{1} * v * v;
  }
  const double n = static_cast<double>(photo.data.size());
  return std::sqrt(squares / n - (sum / n) * (sum / n));
}

TEST(Exposure, LightIsMeanCodeAndShareOfClippedCodes) {
  ImageU8 photo(2, 1);
  photo.data = {255, 0, 0, 51, 51, 51};
  const LightStats stats = MeasureLight(photo);
  EXPECT_DOUBLE_EQ(stats.mean_level, (255 + 153) / (6 * 255.0));
  EXPECT_DOUBLE_EQ(stats.clipped_fraction, 1 / 6.0);
}

TEST(Exposure, MaskedPixelsAreNoLightAndGetNoSayInTheGain) {
  ImageU8 photo(2, 1);
  photo.data = {255, 0, 0, 51, 51, 51};
  PlaneU8 mask(2, 1);
  EXPECT_EQ(MeasureLight(photo, mask).mean_level, 0);
  mask.data[1] = 255;
  EXPECT_DOUBLE_EQ(MeasureLight(photo, mask).mean_level, 0.2);
  EXPECT_DOUBLE_EQ(MeasureLight(photo, mask).clipped_fraction, 0);
  ImageU8 halves(40, 8);
  PlaneU8 right(40, 8);
  for (int i = 0; i < 320; ++i) {
    right.data[i] = i % 40 < 20 ? 0 : 255;
    std::fill_n(&halves.data[3 * i], 3, uint8_t(i % 40 < 20 ? 200 : 20));
  }
  const auto prepared = [&](const PlaneU8& of) {
    return Prepare(halves, Preparation::kGainBlur07, of).pixel(35, 4)[0];
  };
  EXPECT_NEAR(prepared(right), 0.45 * 255, 1);
  EXPECT_LT(prepared({}), 30);
}

TEST(Exposure, ClassesFollowMeanAndClipping) {
  EXPECT_EQ(ClassifyExposure({.mean_level = 0.045}), Exposure::kLow);
  EXPECT_EQ(ClassifyExposure({.mean_level = 0.49}), Exposure::kNormal);
  EXPECT_EQ(ClassifyExposure({.mean_level = 0.62, .clipped_fraction = 0.13}), Exposure::kNormal);
  EXPECT_EQ(ClassifyExposure({.mean_level = 0.78, .clipped_fraction = 0.2}), Exposure::kOver);
  EXPECT_EQ(ClassifyExposure({.mean_level = 0.6, .clipped_fraction = 0.4}), Exposure::kOver);
}

TEST(Exposure, EachClassHasItsLadder) {
  EXPECT_THAT(
      Ladder(Exposure::kLow),
      ElementsAre(Preparation::kGainBlur07, Preparation::kGainBlur12, Preparation::kGainClahe));
  EXPECT_THAT(Ladder(Exposure::kOver), ElementsAre(Preparation::kClahe, Preparation::kRaw));
  EXPECT_THAT(Ladder(Exposure::kNormal), ElementsAre(Preparation::kRaw, Preparation::kClahe));
}

TEST(Exposure, RawKeepsEveryByte) {
  const ImageU8 photo = NoisyPhoto(100, 60);
  EXPECT_EQ(Prepare(photo, Preparation::kRaw).data, photo.data);
}

TEST(Exposure, GainBringsADarkPhotoToItsMeanAndBlurTakesTheNoise) {
  const ImageU8 photo = NoisyPhoto(12, 6);
  const ImageU8 mild = Prepare(photo, Preparation::kGainBlur07);
  const ImageU8 strong = Prepare(photo, Preparation::kGainBlur12);
  // Rounding to bytes shifts a mean by at most half a code.
  EXPECT_NEAR(MeasureLight(mild).mean_level, 0.45, 0.5 / 255);
  EXPECT_NEAR(MeasureLight(strong).mean_level, 0.45, 0.5 / 255);
  const double gain = MeasureLight(mild).mean_level / MeasureLight(photo).mean_level;
  EXPECT_LT(StandardDeviation(mild), 0.6 * gain * StandardDeviation(photo));
  EXPECT_LT(StandardDeviation(strong), 0.7 * StandardDeviation(mild));
}

TEST(Exposure, GainNeverDarkensAndABlackPhotoStaysBlack) {
  const ImageU8 bright = NoisyPhoto(180, 20);
  EXPECT_NEAR(MeasureLight(Prepare(bright, Preparation::kGainBlur07)).mean_level,
              MeasureLight(bright).mean_level, 0.5 / 255);
  EXPECT_EQ(MeasureLight(Prepare(ImageU8(8, 8), Preparation::kGainBlur07)).mean_level, 0);
}

TEST(Exposure, ClaheRaisesTheContrastOfAFlatPhoto) {
  const ImageU8 flat = NoisyPhoto(220, 8);
  EXPECT_GT(StandardDeviation(Prepare(flat, Preparation::kClahe)), 1.5 * StandardDeviation(flat));
  const ImageU8 dark = NoisyPhoto(12, 3);
  EXPECT_GT(StandardDeviation(Prepare(dark, Preparation::kGainClahe)), 5 * StandardDeviation(dark));
}

}  // namespace
}  // namespace litags
