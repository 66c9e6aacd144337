#include "engine/target/highlights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/color.h"
#include "engine/target/float_image.h"

namespace litags {
namespace {

constexpr int kWidth = 240, kHeight = 200;
constexpr double kGain = 0.25;  // the photo is two stops over

double Curve(double linear) { return SrgbFromLinear(std::clamp(kGain * linear, 0.0, 1.0)); }

// A photo of a scene whose codes are given, two stops over-exposed.
template <class Scene>
ImageU8 OverExposed(const Scene& scene) {
  ImageU8 photo(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const std::array<double, 3> code = scene(x, y);
      for (int c = 0; c < 3; ++c) {
        const double light = std::min(1.0, LinearFromSrgb(code[c]) / kGain);
        photo.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(255 * SrgbFromLinear(light)));
      }
    }
  }
  return photo;
}

ImageU8 Fill(const ImageU8& codes) {
  const Photo photo = PhotoFromU8(codes);
  const ClippedColors colors(CollectPalette({photo}, {1.0}, kGain, {}), 1);
  return PhotoToU8(FillHighlights(photo, kGain, colors, Curve));
}

double Code(const ImageU8& image, int x, int y, int c) { return image.pixel(x, y)[c] / 255.0; }

TEST(Highlights, WhatIsNotClippedOnlyGoesThroughTheCurve) {
  const auto scene = [](int x, int y) {
    return std::array<double, 3>{0.4 * x / kWidth, 0.4 * y / kHeight, 0.2};
  };
  const ImageU8 filled = Fill(OverExposed(scene));
  for (int y = 0; y < kHeight; y += 7) {
    for (int x = 0; x < kWidth; x += 7) {
      // The photo's bytes and the target's, each rounded.
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(Code(filled, x, y, c), scene(x, y)[c], 1.5 / 255);
    }
  }
}

TEST(Highlights, AClippedChannelIsEstimatedFromTheOthers) {
  // One colour at growing brightness: red clips first, from x = 100 on.
  const auto scene = [](int x, int) {
    const double light = 0.05 + 0.0018 * x;
    return std::array<double, 3>{SrgbFromLinear(1.087 * light), SrgbFromLinear(0.6 * light),
                                 SrgbFromLinear(0.4 * light)};
  };
  const ImageU8 photo = OverExposed(scene);
  ASSERT_EQ(photo.pixel(150, 60)[0], 255);
  ASSERT_LT(photo.pixel(150, 60)[1], 240);
  const ImageU8 filled = Fill(photo);
  for (int x = 120; x <= 180; x += 20) {
    EXPECT_NEAR(Code(filled, x, 60, 0), scene(x, 60)[0], 0.03) << x;
    EXPECT_NEAR(Code(filled, x, 60, 1), scene(x, 60)[1], 1.5 / 255) << x;
  }
}

TEST(Highlights, TwoClippedChannelsTakeTheColorOfTheShade) {
  // Wood, in the shade on the left, and lit on the right so that red and green are clipped there;
  // a grey wall below.
  const auto scene = [](int x, int y) {
    if (y >= 80) return std::array<double, 3>{0.3, 0.3, 0.3};
    const double light = x < 60 ? 0.15 : 0.85;
    return std::array<double, 3>{SrgbFromLinear(light), SrgbFromLinear(0.45 * light),
                                 SrgbFromLinear(0.15 * light)};
  };
  const ImageU8 photo = OverExposed(scene);
  ASSERT_EQ(photo.pixel(150, 40)[0], 255);
  ASSERT_EQ(photo.pixel(150, 40)[1], 255);
  ASSERT_LT(photo.pixel(150, 40)[2], 240);
  const ImageU8 filled = Fill(photo);
  for (int x = 90; x <= 190; x += 20) {
    EXPECT_NEAR(Code(filled, x, 40, 0), scene(x, 40)[0], 0.05) << x;
    EXPECT_NEAR(Code(filled, x, 40, 1), scene(x, 40)[1], 0.05) << x;
    EXPECT_NEAR(Code(filled, x, 40, 2), scene(x, 40)[2], 1.5 / 255) << x;
  }
}

// Around the middle, as bright as `code` of the distance from there.
template <class Code>
ImageU8 FilledDisk(const Code& code) {
  return Fill(OverExposed([&](int x, int y) {
    const double c = code(std::hypot(x - 100, y - 60));
    return std::array<double, 3>{c, c, c};
  }));
}

// The code of what is clipped, `fill` of the way to 1.
double Filled(double fill) { return Curve(1) + fill * (1 - Curve(1)); }

TEST(Highlights, ALampIsBrightUpToItsRim) {
  const ImageU8 filled = FilledDisk([](double r) { return r < 40 ? 0.9 : 0.3; });
  for (int x = 63; x <= 100; ++x) {
    EXPECT_NEAR(Code(filled, x, 60, 1), Filled(kSurfaceFill + kLightFill), 0.05) << x;
  }
  EXPECT_NEAR(Code(filled, 20, 60, 1), 0.3, 2.0 / 255);
}

TEST(Highlights, ASurfaceThatGrowsBrighterIsLittleBrighterThanWhiteAtFirst) {
  // Clipped within 40 pixels of the middle.
  const ImageU8 filled = FilledDisk([](double r) { return Curve(1) + 0.004 * (40 - r); });
  EXPECT_LT(Code(filled, 63, 60, 1), Filled(0.75 * kSurfaceFill));
  EXPECT_NEAR(Code(filled, 100, 60, 1), Filled(kSurfaceFill), 0.02) << "no lamp";
  for (int x = 20; x < 100; ++x) {
    EXPECT_GE(Code(filled, x + 1, 60, 1), Code(filled, x, 60, 1) - 1.0 / 255) << x;
  }
}

// The size of the smoothing is that of the picture, whichever way the camera was held.
TEST(Highlights, CodesOfATurnedPhotoAreSmoothedAlike) {
  Photo photo(1600, 40), turned(40, 1600);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 1600; ++x) {
      for (int c = 0; c < 3; ++c) {
        photo.pixel(x, y)[c] = turned.pixel(y, x)[c] = (x / 7 + y / 5) % 2 == 0 ? kPhotoWhite : 0;
      }
    }
  }
  const FloatImage a = SmoothCodes(photo), b = SmoothCodes(turned);
  for (int x = 0; x < 1600; ++x) ASSERT_NEAR(a(20, x)[0], b(x, 20)[0], 1e-5) << x;
}

ImageU8 Turned(const ImageU8& photo) {
  ImageU8 out(photo.height, photo.width);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) std::copy_n(photo.pixel(x, y), 3, out.pixel(y, x));
  }
  return out;
}

TEST(Highlights, APortraitPhotoIsFilledAsALandscapeOneIs) {
  // A surface that grows brighter, a lamp and a coloured wall that clips.
  const ImageU8 photo = OverExposed([](int x, int y) {
    const double surface = Curve(1) + 0.004 * (40 - std::hypot(x - 50, y - 60));
    if (std::hypot(x - 140, y - 30) < 20) return std::array<double, 3>{0.9, 0.9, 0.9};
    if (y > 80 && x > 100) return std::array<double, 3>{0.4 + 0.002 * x, 0.4, 0.3};
    return std::array<double, 3>{surface, surface, surface};
  });
  const ImageU8 filled = Turned(Fill(photo)), of_turned = Fill(Turned(photo));
  for (size_t i = 0; i < filled.data.size(); ++i) {
    ASSERT_NEAR(filled.data[i], of_turned.data[i], 1) << i;
  }
}

TEST(Highlights, AWhitePhotoStaysInRange) {
  ImageU8 white(kWidth, kHeight);
  std::fill(white.data.begin(), white.data.end(), 255);
  const ImageU8 filled = Fill(white);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(Code(filled, 10, 10, c), Filled(kSurfaceFill + kLightFill), 1.0 / 255);
  }
}

}  // namespace
}  // namespace litags
