#include "engine/target/white_balance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/mask.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Blocks of grey in a light of this colour.
Photo Greys(const std::array<double, 3>& light, double exposure) {
  Photo photo(64, 48);
  const CounterRng rng(1, 2);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const double albedo = 0.1 + 0.8 * rng.Uniform((y / 4) * 100 + x / 4);
      for (int c = 0; c < 3; ++c) {
        photo.pixel(x, y)[c] =
            PhotoSample(static_cast<float>(SrgbFromLinear(exposure * albedo * light[c])));
      }
    }
  }
  return photo;
}

TEST(WhiteBalance, AGreyPhotoHasTheChromaticityOfItsLightAtAnyExposure) {
  for (const double exposure : {0.5, 0.05, 0.005}) {
    const auto found = ChromaticityOf(Greys({1.5, 1, 0.4}, exposure), PlaneU8());
    ASSERT_TRUE(found.has_value());
    EXPECT_NEAR((*found)[0], std::log(1.5), 0.01) << exposure;
    EXPECT_NEAR((*found)[1], std::log(0.4), 0.01) << exposure;
  }
}

TEST(WhiteBalance, ClippedAndMaskedBlocksDoNotCount) {
  Photo photo = Greys({1.5, 1, 0.4}, 0.3);
  PlaneU8 mask(photo.width, photo.height);
  std::fill(mask.data.begin(), mask.data.end(), kCounts);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) photo.pixel(x, y)[c] = kPhotoWhite;
      photo.pixel(x, y + 8)[0] = kPhotoWhite / 2, photo.pixel(x, y + 8)[2] = kPhotoWhite * 9 / 10;
      mask.data[(y + 8) * mask.width + x] = 0;
    }
  }
  const auto found = ChromaticityOf(photo, mask);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR((*found)[0], std::log(1.5), 0.01);
  EXPECT_NEAR((*found)[1], std::log(0.4), 0.01);
}

TEST(WhiteBalance, BlackWhiteAndTinyPhotosHaveNone) {
  EXPECT_FALSE(ChromaticityOf(Photo(16, 16), PlaneU8()).has_value());
  EXPECT_FALSE(ChromaticityOf(Photo(3, 3), PlaneU8()).has_value());
  EXPECT_FALSE(ChromaticityOf(Photo(), PlaneU8()).has_value());
  Photo white(16, 16);
  std::fill(white.data.begin(), white.data.end(), kPhotoWhite);
  EXPECT_FALSE(ChromaticityOf(white, PlaneU8()).has_value());
}

TEST(WhiteBalance, AChannelWithoutLightIsBounded) {
  const auto found = ChromaticityOf(Greys({1, 1, 0}, 0.5), PlaneU8());
  ASSERT_TRUE(found.has_value());
  EXPECT_DOUBLE_EQ((*found)[1], -kMostCast);
}

TEST(WhiteBalance, PlausibleLightIsLeftAlone) {
  // Neutral, a warm room, a bluish evening, a wrong white balance.
  for (const Chromaticity c : {Chromaticity{0, 0}, {0.5, -0.9}, {-0.2, 0.4}, {-0.25, 0.1}})
    EXPECT_THAT(SceneWhiteBalance({c, c, c}), ElementsAre(1, 1, 1)) << c[0] << " " << c[1];
}

TEST(WhiteBalance, SodiumLightIsNeutralised) {
  const std::array<double, 3> cast = SceneWhiteBalance({{0.82, -2.6}, {0.8, -2.5}, {0.9, -2.7}});
  // To the mean of photos, which is a little warm.
  EXPECT_THAT(
      cast, ElementsAre(DoubleNear(std::exp(0.72), 0.02), 1.0, DoubleNear(std::exp(-2.41), 0.01)));
}

TEST(WhiteBalance, GreenOfLeavesIsNoLight) {
  // sRGB 100 130 60, 70 110 40, 30 60 20.
  for (const Chromaticity c : {Chromaticity{-0.56, -1.6}, {-0.94, -2}, {-1.25, -1.87}})
    EXPECT_THAT(SceneWhiteBalance({c, c, c}), ElementsAre(1, 1, 1)) << c[0] << " " << c[1];
}

TEST(WhiteBalance, BlueOfWaterIsNeutralised) {
  const Chromaticity water = {-1.9, 0.1};
  EXPECT_THAT(SceneWhiteBalance({water, water, water}),
              ElementsAre(DoubleNear(std::exp(-2.0), 0.01), 1.0, DoubleNear(std::exp(0.29), 0.01)));
}

TEST(WhiteBalance, OnePhotoOfManyDecidesNothing) {
  EXPECT_THAT(SceneWhiteBalance({{0.1, -0.2}, {0.8, -2.7}, {0, -0.1}, {0.2, 0}, {0, 0}}),
              ElementsAre(1, 1, 1));
}

TEST(WhiteBalance, NoPhotosAndNoNumbersHaveNoCast) {
  EXPECT_THAT(SceneWhiteBalance({}), ElementsAre(1, 1, 1));
  EXPECT_THAT(SceneWhiteBalance({{kNan, 0}, {0, kNan}}), ElementsAre(1, 1, 1));
  for (const double x : SceneWhiteBalance({{9, -9}, {kNan, 0}})) EXPECT_TRUE(std::isfinite(x));
}

TEST(WhiteBalance, SaysWhatItFound) {
  EXPECT_EQ(DescribeCast({1, 1, 1}), "");
  EXPECT_THAT(DescribeCast({1.9, 1, 0.09}), HasSubstr("red x 1.9, blue x 0.09"));
}

}  // namespace
}  // namespace litags
