#include "engine/stereo/match_image.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/color.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr int kWidth = 160, kHeight = 120;
constexpr double kCode = 60, kNoise = 4;  // of what is lit, 8-bit codes

// Lit on the right; the left `share` of it is of one 8-bit code.
Photo HalfLit(double share, double code, double noise = kNoise) {
  Photo photo(kWidth, kHeight);
  const CounterRng rng(1, 2);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double shown =
          x < share * kWidth ? code : kCode + noise * rng.Normal(uint64_t(y) * kWidth + x);
      for (int c = 0; c < 3; ++c) photo.pixel(x, y)[c] = PhotoSample(float(shown / 255));
    }
  }
  return photo;
}

float NoiseOf(const Photo& photo) {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  const auto image = MakeMatchImage(photo, camera);
  EXPECT_TRUE(image.ok()) << image.status();
  return image.ok() ? image->noise : -1;
}

// By what the root of (light over its mean + 0.05) changes with light: its mean is changed by what
// is beside what is lit.
double Slope(double mean) {
  const double lit = LinearFromSrgb(kCode / 255);
  return 1 / (2 * mean * std::sqrt(lit / mean + 0.05));
}

TEST(MatchImage, NoiseIsThatOfWhatIsNotCutOff) {
  const double lit = LinearFromSrgb(kCode / 255), alone = NoiseOf(HalfLit(0, 0));
  EXPECT_GT(alone, 0.01);
  for (const double code : {0.0, 255.0}) {
    const double mean = 0.6 * LinearFromSrgb(code / 255) + 0.4 * lit;
    const double want = alone * Slope(mean) / Slope(lit);
    EXPECT_NEAR(NoiseOf(HalfLit(0.6, code)), want, 0.2 * want) << code;
  }
}

TEST(MatchImage, WhatIsFlatButNotCutOffHasNoNoise) {
  EXPECT_LT(NoiseOf(HalfLit(0.6, 30)), 1e-5);
  EXPECT_LT(NoiseOf(HalfLit(0.6, 0, /*noise=*/0)), 1e-5);
  for (const double code : {0.0, 60.0, 255.0}) EXPECT_LT(NoiseOf(HalfLit(1, code)), 1e-5) << code;
}

// Most pixels are black, but many blocks have one that is not: that is noise.
TEST(MatchImage, NoiseOfTheFirstCodesCounts) {
  Photo photo(kWidth, kHeight);
  const CounterRng rng(3, 4);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int16_t sample = rng.Uniform(i) < 0.2 ? PhotoSample(1 / 255.0f) : int16_t{0};
    for (int c = 0; c < 3; ++c) photo.data[3 * i + c] = sample;
  }
  EXPECT_GT(NoiseOf(photo), 0.1);
}

}  // namespace
}  // namespace litags
