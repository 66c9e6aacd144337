#include "engine/target/shadow_color.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "engine/core/mask.h"
#include "engine/target/jpeg_test_util.h"

namespace litags {
namespace {

TestColor TestRgb(const TestColor& ycc) {
  return {ycc[0] + 1.402 * ycc[2], ycc[0] - (0.202008 * ycc[1] + 0.419198 * ycc[2]) / 0.587,
          ycc[0] + 1.772 * ycc[1]};
}

constexpr int kWidth = 128, kHeight = 96;

// A photo of a scene in codes after a JPEG encoder's roundings.
template <class Scene>
Photo Rounded(const Scene& scene) {
  Photo photo(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const TestColor rgb = TestRgb(TestJpeg(scene(x, y)));
      for (int c = 0; c < 3; ++c) photo.pixel(x, y)[c] = PhotoSample(rgb[c] / 255);
    }
  }
  return photo;
}

// Root of the mean square error of the colour, (Cb, Cr) / Y, over columns from `from` on.
template <class Scene>
double ColorError(const Photo& photo, const Scene& scene, int from = 0) {
  double squares = 0;
  int n = 0;
  for (int y = 0; y < photo.height; ++y) {
    for (int x = from; x < photo.width; ++x, n += 2) {
      const int16_t* p = photo.pixel(x, y);
      const TestColor seen =
          TestYcc({255 * EncodedOf(p[0]), 255 * EncodedOf(p[1]), 255 * EncodedOf(p[2])});
      const TestColor truth = TestYcc(scene(x, y));
      for (int c = 1; c < 3; ++c) squares += std::pow((seen[c] - truth[c]) / truth[0], 2);
    }
  }
  return std::sqrt(squares / n);
}

ColorPrior PriorOf(const Photo& photo) { return MeasureColorPrior(photo, {.chroma = 2}); }

// A warm wall that gets darker from 8 codes to 0.8, from left to right.
TestColor Wall(int x, int y) {
  const double light = 8 * std::pow(0.1, (x + 0.2 * y) / (kWidth + 0.2 * kHeight));
  return {1.2 * light, light, 0.7 * light};
}

TEST(ShadowColors, DarkWallHasOneColor) {
  const Photo photo = Rounded(Wall);
  const Photo inferred = ShadowColors(PriorOf(photo)).Infer(photo);
  EXPECT_GT(ColorError(photo, Wall, kWidth / 2), 0.2);
  EXPECT_LT(ColorError(inferred, Wall, kWidth / 2), 0.65 * ColorError(photo, Wall, kWidth / 2));
  EXPECT_LT(ColorError(inferred, Wall), 0.65 * ColorError(photo, Wall));
}

// A file of 16 bits tells the colour of what is as dark as that, and keeps it.
TEST(ShadowColors, DarkColorsOfDeepFilesAreTheirOwn) {
  const auto scene = [](int x, int y) -> TestColor {
    const bool object = x / 32 == 1 && y / 32 == 1;
    return object ? TestColor{2.6, 1.6, 1.2} : TestColor{2, 2, 2};
  };
  Photo photo(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) photo.pixel(x, y)[c] = PhotoSample(scene(x, y)[c] / 255);
    }
  }
  const auto error = [&](const FileSteps& steps) {
    return ColorError(ShadowColors(MeasureColorPrior(photo, steps)).Infer(photo), scene);
  };
  EXPECT_LT(error({.code = 1.0 / 257}), 0.02);
  EXPECT_GT(error({.code = 1}), 2 * error({.code = 1.0 / 257}));
}

// Means of 2x2 pixels in linear light.
Photo Half(const Photo& photo) {
  Photo half(photo.width / 2, photo.height / 2);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        float sum = 0;
        for (int i = 0; i < 4; ++i) {
          sum += LinearTable::Get()(photo.pixel(2 * x + i % 2, 2 * y + i / 2)[c]);
        }
        half.pixel(x, y)[c] = SampleTable::Get()(sum / 4);
      }
    }
  }
  return half;
}

// What is inferred of a shrunk photo is as good as what is inferred before it is shrunk.
TEST(ShadowColors, ShrunkPhotosAreInferredAsWholeOnes) {
  const Photo photo = Rounded(Wall);
  const ShadowColors shadows(PriorOf(photo));
  const auto wall = [](int x, int y) { return Wall(2 * x, 2 * y); };
  const double before = ColorError(Half(shadows.Infer(photo)), wall);
  const double after = ColorError(shadows.Infer(Half(photo), {}, 2), wall);
  EXPECT_LT(after, 1.02 * before);
  EXPECT_LT(after, 0.65 * ColorError(Half(photo), wall));
}

// A dark red that noise hides from single pixels, though not from the mean of many: a capture whose
// mean is grey does not take it away.
TEST(ShadowColors, NoisyDarkColorsDoNotFade) {
  constexpr TestColor kRed = {3.2, 1.6, 1.6};
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  const Photo photo = Rounded([&](int, int) {
    TestColor color = kRed;
    for (double& channel : color) channel += normal(random);
    return color;
  });
  ColorPrior prior = PriorOf(photo);
  EXPECT_GT(prior.luma_noise, 0.4);
  prior.cb = prior.cr = 0;
  // The mean of Cr over the mean of Y, in codes, which are linear there.
  const auto saturation = [](const Photo& p) {
    TestColor sum = {};
    for (size_t i = 0; i < p.pixels(); ++i) {
      const TestColor ycc = TestYcc(
          {EncodedOf(p.data[3 * i]), EncodedOf(p.data[3 * i + 1]), EncodedOf(p.data[3 * i + 2])});
      for (int c = 0; c < 3; ++c) sum[c] += ycc[c];
    }
    return sum[2] / sum[0];
  };
  const double inferred = saturation(ShadowColors(prior).Infer(photo));
  EXPECT_GT(inferred, 0.9 * saturation(photo));
  ColorPrior without_noise = prior;
  without_noise.luma_noise = 0;
  EXPECT_LT(saturation(ShadowColors(without_noise).Infer(photo)), 0.95 * inferred);
}

// Where codes tell colours apart, they stay apart.
TEST(ShadowColors, ObjectsKeepTheirColors) {
  const auto scene = [](int x, int) {
    return x < kWidth / 2 ? TestColor{20, 12, 6} : TestColor{9, 14, 12};
  };
  const Photo photo = Rounded(scene);
  const Photo inferred = ShadowColors(PriorOf(photo)).Infer(photo);
  EXPECT_LT(ColorError(inferred, scene), 0.06);
}

TEST(ShadowColors, BrightPixelsStayAsTheyAre) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> code(kShadowTop + 1, 255);
  const Photo photo = Rounded([&](int, int) {
    return TestColor{code(random), code(random), code(random)};
  });
  const Photo inferred = ShadowColors(PriorOf(photo)).Infer(photo);
  EXPECT_EQ(inferred.data, photo.data);
}

TEST(ShadowColors, WhatIsMaskedTellsNothing) {
  const auto scene = [](int x, int y) { return x < kWidth / 2 ? TestColor{2, 30, 2} : Wall(x, y); };
  const Photo photo = Rounded(scene);
  PlaneU8 mask(kWidth, kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) mask.data[i] = i % kWidth < kWidth / 2 ? 0 : kCounts;
  const ColorPrior prior = MeasureColorPrior(photo, {.chroma = 2}, mask);
  EXPECT_GT(prior.cr, 0);
  const double told = ColorError(photo, Wall, kWidth / 2);
  const ShadowColors colors(prior);
  const double masked = ColorError(colors.Infer(photo, mask), Wall, kWidth / 2);
  EXPECT_LT(masked, 0.75 * told);
  // Without the mask the bright green beside it is believed.
  const ShadowColors unmasked(PriorOf(photo));
  EXPECT_GT(ColorError(unmasked.Infer(photo), Wall, kWidth / 2), 1.1 * masked);
}

TEST(ShadowColors, OddPhotosWork) {
  const ShadowColors colors({.steps = {.chroma = 2}});
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 1}, {1, 700}, {37, 3}}) {
    for (const int16_t sample : {-3000, 0, 40, 300, 32767}) {
      Photo photo(width, height);
      std::fill(photo.data.begin(), photo.data.end(), sample);
      const ColorPrior prior = PriorOf(photo);
      EXPECT_TRUE(std::isfinite(prior.cb + prior.cr));
      const Photo inferred = colors.Infer(photo);
      // Grey of one brightness: at most two codes away from what it was.
      for (size_t i = 0; i < photo.data.size(); ++i) {
        EXPECT_NEAR(inferred.data[i], sample, 2 * kPhotoCode) << width << " " << sample;
      }
    }
  }
}

TEST(MeasureColorPrior, TellsTheMeanColor) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  const auto scene = [&](int, int) {
    TestColor color = {9, 6, 4};
    for (double& channel : color) channel += normal(random);
    return color;
  };
  const ColorPrior prior = PriorOf(Rounded(scene));
  const TestColor truth = TestYcc({9, 6, 4});
  EXPECT_NEAR(prior.cb, truth[1] / truth[0], 0.05);
  EXPECT_NEAR(prior.cr, truth[2] / truth[0], 0.05);
  EXPECT_EQ(prior.steps.chroma, 2);
}

TEST(MedianPrior, IsOfEachFigureAndTheCoarsestStep) {
  const ColorPrior a = {.cb = 1, .cr = 5, .steps = {1, 2}, .luma_noise = 0.5},
                   b = {.cb = 2, .cr = 4, .steps = {0.25, 9}, .luma_noise = 0.1},
                   c = {.cb = 3, .cr = 6, .steps = {0.5, 1}, .luma_noise = 0.2};
  const ColorPrior median = MedianPrior({a, b, c});
  EXPECT_EQ(median.cb, 2);
  EXPECT_EQ(median.cr, 5);
  EXPECT_EQ(median.luma_noise, 0.2);
  EXPECT_EQ(median.steps.code, 1);
  EXPECT_EQ(median.steps.chroma, 9);
}

TEST(MedianPrior, PhotosWithoutDarkPixelsSayNothingOfNoise) {
  const std::vector<ColorPrior> priors = {
      ColorPrior(), ColorPrior(), ColorPrior(), {.steps = {}, .luma_noise = 2}};
  EXPECT_EQ(MedianPrior(priors).luma_noise, 2);
}

TEST(MeasureColorPrior, NothingKnownIsGrey) {
  const ColorPrior prior = MeasureColorPrior(Photo(), {});
  EXPECT_EQ(MedianPrior({}).cb, 0);
  EXPECT_EQ(prior.cb, 0);
  EXPECT_EQ(prior.cr, 0);
}

}  // namespace
}  // namespace litags
