#include "engine/enhance/enhance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/target/tone_options.h"

namespace litags {
namespace {

// The paper's theta has a name in each of the two folders, which may not include each other.
static_assert(kEnhancedMean == ToneOptions().theta);

// A room: two walls of different colour under light that falls off from left to right, with a
// little noise; `exposure` is in linear light.
ImageU8 Room(double exposure) {
  ImageU8 photo(96, 64);
  const CounterRng rng(5, 0);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const double light = 0.2 + 0.8 * (1 - x / 95.0);
      const double albedo[3] = {y < 32 ? 0.8 : 0.2, 0.5, y < 32 ? 0.3 : 0.6};
      for (int c = 0; c < 3; ++c) {
        const double noise = 0.5 * rng.Normal((uint64_t(y) * 96 + x) * 3 + c);
        const double code = 255 * SrgbFromLinear(std::min(1.0, exposure * light * albedo[c]));
        photo.pixel(x, y)[c] =
            static_cast<uint8_t>(std::clamp(std::round(code + noise), 0.0, 255.0));
      }
    }
  }
  return photo;
}

double Mean(const ImageU8& image) {
  double mean = 0;
  for (const uint8_t code : image.data) mean += code / (255.0 * image.data.size());
  return mean;
}

double Rmse(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) sum += std::pow((a.data[i] - b.data[i]) / 255.0, 2);
  return std::sqrt(sum / a.data.size());
}

TEST(Enhance, TheNamesAreThoseOfTheTable) {
  std::vector<std::string> names;
  for (const Enhancer& enhancer : BuiltinEnhancers()) names.push_back(enhancer.name);
  EXPECT_EQ(names,
            (std::vector<std::string>{"gain", "light-gain", "gamma", "histeq", "clahe", "lime"}));
}

TEST(Enhance, EveryEnhancerKeepsTheSizeAndBringsADarkPhotoNearerToTheNormalOne) {
  const ImageU8 dark = Room(0.02), normal = Room(1.0);
  for (const Enhancer& enhancer : BuiltinEnhancers()) {
    const ImageU8 out = enhancer.run(dark).value();
    ASSERT_EQ(out.width, dark.width);
    ASSERT_EQ(out.height, dark.height);
    EXPECT_GT(Mean(out), Mean(dark)) << enhancer.name;
    EXPECT_LT(Rmse(out, normal), Rmse(dark, normal)) << enhancer.name;
  }
}

// Alone in its process, as CTest runs it, OpenCV's tables are not made yet; made twice, one set
// leaks, which AddressSanitizer tells.
TEST(Enhance, ThreadsThatComeFirstMakeWhatOneMakes) {
  const ImageU8 photo = Room(0.05);
  std::vector<ImageU8> out(4);
  ParallelFor(4, out.size(), [&](size_t i, int) { out[i] = EnhanceClahe(photo); });
  const ImageU8 expected = EnhanceClahe(photo);
  for (const ImageU8& picture : out) EXPECT_EQ(picture.data, expected.data);
}

TEST(Enhance, CurvesReachTheirMean) {
  // Within a code: where a curve is steep, one step of its parameter is less than that.
  for (const double exposure : {0.02, 0.2, 1.0}) {
    const ImageU8 photo = Room(exposure);
    EXPECT_NEAR(Mean(EnhanceLightGain(photo)), kEnhancedMean, 1.0 / 255) << exposure;
    EXPECT_NEAR(Mean(EnhanceGamma(photo)), kEnhancedMean, 1.0 / 255) << exposure;
  }
  EXPECT_NEAR(Mean(EnhanceGain(Room(1.0))), kEnhancedMean, 2.0 / 255);  // hardly clips
}

TEST(Enhance, GainInLinearLightUndoesAnExposure) {
  // Codes of the darkened photo are coarse (an exposure of 1/20 leaves some 60 of them).
  const ImageU8 undone = EnhanceLightGain(Room(0.05)), reference = EnhanceLightGain(Room(1.0));
  EXPECT_LT(Rmse(undone, reference), 0.02);
  EXPECT_GT(Rmse(EnhanceGain(Room(0.05)), EnhanceGain(Room(1.0))), 0.03);
}

TEST(Enhance, AnOverexposedPhotoIsDarkened) {
  const ImageU8 over = Room(3);
  ASSERT_GT(Mean(over), 0.7);
  for (const Enhancer& enhancer : BuiltinEnhancers()) {
    if (enhancer.name == "clahe" || enhancer.name == "histeq") continue;  // contrast, not light
    EXPECT_LT(Mean(enhancer.run(over).value()), Mean(over) - 0.05) << enhancer.name;
  }
}

TEST(Enhance, BlackStaysBlackUnderCurves) {
  const ImageU8 black(20, 12);
  EXPECT_EQ(EnhanceGain(black).data, black.data);
  EXPECT_EQ(EnhanceLightGain(black).data, black.data);
  EXPECT_EQ(EnhanceGamma(black).data, black.data);
  EXPECT_EQ(EnhanceLime(black).data, black.data);
}

TEST(Lime, EvensTheLightOutAcrossAShadowsEdge) {
  ImageU8 wall(256, 40);
  for (int y = 0; y < wall.height; ++y) {
    for (int x = 0; x < wall.width; ++x) {
      const uint8_t color[3] = {static_cast<uint8_t>(x < 128 ? 120 : 30), 20, 10};
      std::copy_n(color, 3, wall.pixel(x, y));
    }
  }
  const ImageU8 out = EnhanceLime(wall);
  const double ratio = double(out.pixel(60, 20)[0]) / out.pixel(190, 20)[0];
  // 4 before; the fifth root of that (1.32) with a map that is red exactly, more because smoothing
  // across the edge lifts the map on its dark side.
  EXPECT_GT(ratio, 1.2);
  EXPECT_LT(ratio, 1.6);
}

TEST(Lime, TakesALargePhoto) {
  ImageU8 photo(640, 480);  // more than the map has
  std::fill(photo.data.begin(), photo.data.end(), uint8_t{40});
  const ImageU8 out = EnhanceLime(photo);
  ASSERT_EQ(out.width, 640);
  EXPECT_NEAR(out.pixel(350, 250)[1], 255 * std::pow(40.0 / 255, 0.2), 1);
}

TEST(Lime, KeepsTheColourOfEachPixel) {
  const ImageU8 dark = Room(0.2), out = EnhanceLime(dark);
  for (int x = 5; x < 90; x += 10) {
    const uint8_t *a = dark.pixel(x, 40), *b = out.pixel(x, 40);
    EXPECT_NEAR(double(b[1]) / b[2], double(a[1]) / a[2], 0.02) << x;  // rounding of codes near 60
  }
}

TEST(Lime, NoiseIsNotTakenForLight) {
  // One wall, no edges: neighbours differ by noise alone, which division by a map that follows it
  // would wipe out (the largest channel would come out flat). It must stay.
  ImageU8 wall(64, 48);
  const CounterRng rng(9, 0);
  for (size_t i = 0; i < wall.data.size(); ++i) {
    wall.data[i] = static_cast<uint8_t>(std::lround(40 + 3 * rng.Normal(i)));
  }
  const auto contrast = [](const ImageU8& image) {
    const double mean = 255 * Mean(image);
    double sum = 0;
    for (const uint8_t code : image.data) sum += std::pow(code / mean - 1, 2);
    return std::sqrt(sum / image.data.size());
  };
  EXPECT_GT(contrast(EnhanceLime(wall)), 0.8 * contrast(wall));
}

}  // namespace
}  // namespace litags
