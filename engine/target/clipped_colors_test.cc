#include "engine/target/clipped_colors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/mask.h"

namespace litags {
namespace {

constexpr double kOrange[3] = {1, 0.35, 0.08}, kTeal[3] = {0.15, 0.5, 0.55};
constexpr int kWidth = 80, kHeight = 60;

Rgb Log(const double (&color)[3], double light) {
  Rgb log;
  for (int c = 0; c < 3; ++c) log[c] = std::log(light * color[c]);
  return log;
}

// Both colours in the shade: nothing of them is clipped in a photo of exposure 1.
ScenePalette ShadedColors() {
  ScenePalette palette;
  for (int i = 0; i < 100; ++i) {
    palette.push_back(Log(kOrange, 0.2 + 0.007 * i));
    palette.push_back(Log(kTeal, 0.2 + 0.007 * i));
  }
  return palette;
}

Rgb CodesOf(const double (&color)[3], double light) {
  Rgb codes;
  for (int c = 0; c < 3; ++c) codes[c] = SrgbFromLinear(std::min(1.0, light * color[c]));
  return codes;
}

// log(R / G) of `ratio` less that of the colour.
double ErrorOfRedOverGreen(const Rgb& ratio, const double (&color)[3]) {
  return ratio[0] - ratio[1] - std::log(color[0] / color[1]);
}

Photo Uniform(int r, int g, int b) {
  ImageU8 photo(kWidth, kHeight);
  for (size_t i = 0; i < photo.data.size(); ++i)
    photo.data[i] = i % 3 == 0 ? r : i % 3 == 1 ? g : b;
  return PhotoFromU8(photo);
}

TEST(ClippedColors, WhatIsNotClippedKeepsItsColor) {
  const ClippedColors colors(ShadedColors(), 1);
  const double grey[3] = {1, 1, 1}, pink[3] = {1, 0.5, 0.6};
  for (double light : {0.1, 0.4, 0.8}) {
    EXPECT_NEAR(ErrorOfRedOverGreen(colors.LogRatio(CodesOf(grey, light)), grey), 0, 1e-5);
    // Between nodes of the table.
    EXPECT_NEAR(ErrorOfRedOverGreen(colors.LogRatio(CodesOf(pink, light)), pink), 0, 0.02);
  }
}

TEST(ClippedColors, OneClippedChannelFollowsFromTheOthers) {
  const ClippedColors colors(ShadedColors(), 1);
  const Rgb codes = CodesOf(kOrange, 2);  // light of 2, 0.7, 0.16
  ASSERT_EQ(codes[0], 1);
  EXPECT_NEAR(ErrorOfRedOverGreen(colors.LogRatio(codes), kOrange), 0, 0.05);
}

TEST(ClippedColors, OrangeWithRedAndGreenClippedIsNotYellow) {
  const ClippedColors colors(ShadedColors(), 1);
  const Rgb codes = CodesOf(kOrange, 3.5);
  ASSERT_EQ(codes[0], 1);
  ASSERT_EQ(codes[1], 1);
  // Cut off at white, the error would be log(0.35) = -1.05.
  EXPECT_NEAR(ErrorOfRedOverGreen(colors.LogRatio(codes), kOrange), 0, 0.1);
}

TEST(ClippedColors, EstimatesAreNotBelowWhite) {
  const ClippedColors colors(ShadedColors(), 1);
  for (float code = 0; code < 0.95f; code += 0.05f) {
    const Rgb ratio = colors.LogRatio({1, 1, code});
    const double measured = LinearFromSrgb(std::max(code, 0.08f));  // below it counts as as dark
    for (int c = 0; c < 2; ++c) {
      EXPECT_GE(std::exp(ratio[c] - ratio[2]) * measured, 0.9) << code << " " << c;
    }
  }
}

TEST(ClippedColors, ColorsAsBrightAsThePhotoSawAreTheLikelier) {
  // Seen in photos of less exposure; both would clip red and green at either exposure below.
  const double yellow[3] = {1, 0.9, 0.08};
  ScenePalette palette;
  for (int i = 0; i < 100; ++i) {
    palette.push_back(Log(kOrange, 3 + 0.005 * i));
    palette.push_back(Log(yellow, 48 + 0.08 * i));
  }
  const Rgb codes = CodesOf(kOrange, 3.2);
  EXPECT_LT(std::abs(ErrorOfRedOverGreen(ClippedColors(palette, 1).LogRatio(codes), kOrange)), 0.3);
  EXPECT_LT(std::abs(ErrorOfRedOverGreen(ClippedColors(palette, 1.0 / 16).LogRatio(codes), yellow)),
            0.3);
}

TEST(ClippedColors, WithoutAPaletteColorsAreTheCodes) {
  const ClippedColors colors({}, 1);
  const Rgb ratio = colors.LogRatio({1, 1, 0.5f});
  EXPECT_NEAR(ratio[0], ratio[1], 1e-6);
  EXPECT_NEAR(ratio[0] - ratio[2], -std::log(LinearFromSrgb(0.5)), 0.02);
}

TEST(CollectPalette, ColorsDoNotDependOnTheExposure) {
  const double light[3] = {0.4, 0.2, 0.1};
  std::vector<Photo> photos;
  const std::vector<double> exposures = {1, 2};
  for (double exposure : exposures) {
    std::array<int, 3> codes;
    for (int c = 0; c < 3; ++c) codes[c] = std::lround(255 * SrgbFromLinear(exposure * light[c]));
    photos.push_back(Uniform(codes[0], codes[1], codes[2]));
  }
  const ScenePalette palette = CollectPalette(photos, exposures, 0.25, {});
  EXPECT_GT(palette.size(), 1000u);
  EXPECT_LE(palette.size(), 3000u);
  for (const auto& color : palette) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(color[c], std::log(light[c]), 0.03);
  }
}

TEST(CollectPalette, WhatIsClippedIsAnyWhiteThatThePhotoCannotShow) {
  const ScenePalette palette = CollectPalette({Uniform(255, 255, 255)}, {2.0}, 0.25, {});
  ASSERT_GT(palette.size(), 1000u);
  float least = 10, most = -10;
  for (const auto& color : palette) {
    EXPECT_EQ(color[0], color[1]);
    EXPECT_EQ(color[0], color[2]);
    least = std::min(least, color[0]);
    most = std::max(most, color[0]);
  }
  EXPECT_NEAR(least, std::log(0.5), 0.01);  // the photo's white
  EXPECT_NEAR(most, std::log(4.0), 0.01);   // the target's
}

TEST(CollectPalette, IsTheSameForAnyThreadsAndEmptyOnceCancelled) {
  const std::vector<Photo> photos = {Uniform(255, 255, 255), Uniform(120, 90, 60),
                                     Uniform(255, 255, 254)};
  const std::vector<double> exposures = {2, 1, 1.5};
  const auto palette = [&](int threads, const CancelToken& cancel) {
    return CollectPalette(photos, exposures, 0.25, {}, {}, threads, cancel);
  };
  const ScenePalette one = palette(1, CancelToken());
  EXPECT_GT(one.size(), 1000u);
  EXPECT_EQ(one, palette(3, CancelToken()));
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_TRUE(palette(3, cancel).empty());
}

TEST(CollectPalette, MaskedDarkAndPartlyClippedPixelsAreLeftOut) {
  PlaneU8 mask(kWidth, kHeight);
  EXPECT_TRUE(CollectPalette({Uniform(120, 90, 60)}, {1.0}, 0.25, {mask}).empty());
  EXPECT_TRUE(CollectPalette({Uniform(120, 90, 3)}, {1.0}, 0.25, {}).empty());
  EXPECT_TRUE(CollectPalette({Uniform(255, 90, 60)}, {1.0}, 0.25, {}).empty());
  std::fill(mask.data.begin(), mask.data.end(), kCounts);
  EXPECT_FALSE(CollectPalette({Uniform(120, 90, 60)}, {1.0}, 0.25, {mask}).empty());
}

}  // namespace
}  // namespace litags
