#include "engine/eval/noise.h"

#include <cmath>

#include "engine/core/rng.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr int kWidth = 120, kHeight = 90;

// Two walls of a plain colour, stripes between them.
Planes CleanPicture() {
  Planes clean(3, kHeight, kWidth);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool stripes = x >= 40 && x < 80;
        clean.at(c, y, x) = stripes ? 0.5f + 0.3f * std::sin(1.3f * x) : x < 40 ? 0.3f : 0.7f;
      }
    }
  }
  return clean;
}

Planes Noisy(Planes picture, double deviation, uint64_t seed = 1) {
  const CounterRng rng(seed, 1);
  for (size_t i = 0; i < picture.data.size(); ++i) {
    picture.data[i] += static_cast<float>(deviation * rng.Normal(i));
  }
  return picture;
}

double Measure(const Planes& picture, const Planes& clean) {
  const auto noise = FlatNoise(picture, clean, FlatPixels(clean, 0.5));
  EXPECT_TRUE(noise.ok()) << noise.status();
  return noise.value_or(-1);
}

TEST(FlatNoise, StripesAreNotFlat) {
  const std::vector<char> flat = FlatPixels(CleanPicture(), 0.5);
  int walls = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x >= 38 && x < 82) {
        EXPECT_FALSE(flat[y * kWidth + x]) << x << " " << y;
      } else {
        walls += flat[y * kWidth + x];
      }
    }
  }
  // Half of the picture, or more where pixels are equally flat.
  EXPECT_GE(walls, kWidth * kHeight / 2 - 1);
}

TEST(FlatNoise, FindsTheDeviationThatWasAdded) {
  const Planes clean = CleanPicture();
  EXPECT_EQ(Measure(clean, clean), 0);
  for (const double deviation : {0.01, 0.05}) {
    // 16,000 samples: 0.6 %; a local mean of a few hundred pixels takes 0.2 % of it.
    EXPECT_NEAR(Measure(Noisy(clean, deviation), clean), deviation, 0.02 * deviation);
  }
}

TEST(FlatNoise, ToneIsNoNoiseButBlotchesAre) {
  const Planes clean = CleanPicture();
  Planes darker = clean, blotched = clean;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        darker.at(c, y, x) = 0.9f * clean.at(c, y, x) + 0.0005f * y;  // a gentle shade, too
        blotched.at(c, y, x) += 0.05f * std::sin(0.6f * x) * std::sin(0.6f * y);  // 10 px
      }
    }
  }
  EXPECT_LT(Measure(darker, clean), 0.002);
  EXPECT_NEAR(Measure(blotched, clean), 0.025, 0.002);
}

TEST(FlatNoise, NoiseOnEdgesDoesNotCount) {
  const Planes clean = CleanPicture();
  Planes picture = clean;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 44; x < 76; ++x) picture.at(c, y, x) = 0;
    }
  }
  EXPECT_EQ(Measure(picture, clean), 0);
}

TEST(FlatNoise, OtherSizesAreRefused) {
  const Planes clean = CleanPicture();
  const std::vector<char> flat = FlatPixels(clean);
  EXPECT_FALSE(FlatNoise(Planes(3, 90, 119), clean, flat).ok());
  EXPECT_FALSE(FlatNoise(clean, clean, {}).ok());
  EXPECT_TRUE(FlatPixels(Planes()).empty());
}

TEST(NoiseBetween, IsTheNoiseWithoutWhatBothPicturesLack) {
  const Planes clean = CleanPicture();
  Planes spoilt = clean;  // a weave on the walls that is not there
  for (size_t i = 0; i < spoilt.data.size(); ++i) spoilt.data[i] += i % 2 == 0 ? 0.05f : -0.05f;
  const Planes one = Noisy(spoilt, 0.02, 1), other = Noisy(spoilt, 0.02, 2);
  EXPECT_GT(Measure(one, clean), 0.045);
  const std::vector<char> flat = FlatPixels(clean, 0.5);
  EXPECT_NEAR(NoiseBetween(one, other, flat).value(), 0.02, 0.001);
  EXPECT_EQ(NoiseBetween(one, one, flat).value(), 0);
  EXPECT_FALSE(NoiseBetween(one, Planes(3, 2, 2), flat).ok());
}

}  // namespace
}  // namespace litags
