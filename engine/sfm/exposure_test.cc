#include "engine/sfm/exposure.h"

#include <cmath>

#include "engine/core/rng.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

// Noise around `level`, so that blur and contrast have something to work on.
Photo NoisyPhoto(int level, int amplitude) {
  ImageU8 photo(64, 48);
  const CounterRng rng(7, 0);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = static_cast<uint8_t>(level + rng.Below(i, 2 * amplitude + 1) - amplitude);
  }
  return PhotoFromU8(photo);
}

double MeanLevel(const ImageU8& copy) { return MeasureLight(PhotoFromU8(copy)).mean_level; }

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
  Photo photo(2, 1);
  photo.data = {kPhotoWhite, 0, 0, 4096, 4096, 4096};
  const LightStats stats = MeasureLight(photo);
  EXPECT_DOUBLE_EQ(stats.mean_level, (1 + 3 * 0.25) / 6);
  EXPECT_DOUBLE_EQ(stats.clipped_fraction, 1 / 6.0);
}

TEST(Exposure, MaskedPixelsAreNoLightAndGetNoSayInTheGain) {
  Photo photo(2, 1);
  photo.data = {kPhotoWhite, 0, 0, 4096, 4096, 4096};
  PlaneU8 mask(2, 1);
  EXPECT_EQ(MeasureLight(photo, mask).mean_level, 0);
  mask.data[1] = 255;
  EXPECT_DOUBLE_EQ(MeasureLight(photo, mask).mean_level, 0.25);
  EXPECT_DOUBLE_EQ(MeasureLight(photo, mask).clipped_fraction, 0);
  ImageU8 halves(40, 8);
  PlaneU8 right(40, 8);
  for (int i = 0; i < 320; ++i) {
    right.data[i] = i % 40 < 20 ? 0 : 255;
    std::fill_n(&halves.data[3 * i], 3, uint8_t(i % 40 < 20 ? 200 : 20));
  }
  const auto prepared = [&](const PlaneU8& of) {
    return Prepare(PhotoFromU8(halves), Preparation::kGainBlur07, of).pixel(35, 4)[0];
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
  const Photo photo = NoisyPhoto(100, 60);
  EXPECT_EQ(Prepare(photo, Preparation::kRaw).data, PhotoToU8(photo).data);
}

TEST(Exposure, GainBringsADarkPhotoToItsMeanAndBlurTakesTheNoise) {
  const Photo photo = NoisyPhoto(12, 6);
  const ImageU8 mild = Prepare(photo, Preparation::kGainBlur07);
  const ImageU8 strong = Prepare(photo, Preparation::kGainBlur12);
  // Rounding to bytes shifts a mean by at most half a code.
  EXPECT_NEAR(MeanLevel(mild), 0.45, 0.5 / 255);
  EXPECT_NEAR(MeanLevel(strong), 0.45, 0.5 / 255);
  const double gain = MeanLevel(mild) / MeasureLight(photo).mean_level;
  EXPECT_LT(StandardDeviation(mild), 0.6 * gain * StandardDeviation(PhotoToU8(photo)));
  EXPECT_LT(StandardDeviation(strong), 0.7 * StandardDeviation(mild));
}

TEST(Exposure, GainNeverDarkensAndABlackPhotoStaysBlack) {
  const Photo bright = NoisyPhoto(180, 20);
  EXPECT_NEAR(MeanLevel(Prepare(bright, Preparation::kGainBlur07)), MeasureLight(bright).mean_level,
              0.5 / 255);
  EXPECT_EQ(MeanLevel(Prepare(Photo(8, 8), Preparation::kGainBlur07)), 0);
}

TEST(Exposure, ClaheRaisesTheContrastOfAFlatPhoto) {
  const Photo flat = NoisyPhoto(220, 8);
  EXPECT_GT(StandardDeviation(Prepare(flat, Preparation::kClahe)),
            1.5 * StandardDeviation(PhotoToU8(flat)));
  const Photo dark = NoisyPhoto(12, 3);
  EXPECT_GT(StandardDeviation(Prepare(dark, Preparation::kGainClahe)),
            5 * StandardDeviation(PhotoToU8(dark)));
}

}  // namespace
}  // namespace litags
