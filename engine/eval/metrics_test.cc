#include "engine/eval/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

ImageU8 Noise(int width, int height, uint64_t stream, int low = 0, int high = 255) {
  ImageU8 image(width, height);
  const CounterRng rng(5, stream);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = low + rng.Below(i, high - low + 1);
  return image;
}

TEST(Metrics, BytesAndPlanesHaveTheSamePsnr) {
  const ImageU8 a = Noise(30, 20, 1), b = Noise(30, 20, 2);
  EXPECT_EQ(*Psnr(a, b), *Psnr(ToPlanes(a), ToPlanes(b)));
}

TEST(Metrics, AConstantOffsetHasTheExpectedPsnr) {
  Planes a(3, 20, 20), b(3, 20, 20);
  for (float& v : b.data) v = 0.1f;
  EXPECT_NEAR(*Psnr(a, b), 20.0, 1e-5);  // 0.1f is not quite 0.1
}

TEST(Metrics, EqualImagesArePerfect) {
  const ImageU8 a = Noise(30, 20, 1);
  EXPECT_EQ(*Psnr(a, a), INFINITY);
  EXPECT_NEAR(*Ssim(a, a), 1, 1e-12);
  EXPECT_NEAR(*Ssim(a, a, SsimBorder::kZero), 1, 1e-12);
}

// One pixel after the other, in the order of the definition.
double SsimOfDefinition(const Planes& a, const Planes& b) {
  const auto weight = [](int k) { return std::exp(-k * k / 4.5); };
  double sum = 0, window = 0;
  for (int k = -5; k <= 5; ++k) window += weight(k);
  for (int c = 0; c < a.channels; ++c) {
    for (int y = 5; y < a.height - 5; ++y) {
      for (int x = 5; x < a.width - 5; ++x) {
        double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
        for (int v = -5; v <= 5; ++v) {
          for (int u = -5; u <= 5; ++u) {
            const double w = weight(u) * weight(v) / (window * window);
            const double va = a.at(c, y + v, x + u), vb = b.at(c, y + v, x + u);
            ma += w * va, mb += w * vb, aa += w * va * va, bb += w * vb * vb, ab += w * va * vb;
          }
        }
        sum += (2 * ma * mb + 1e-4) * (2 * (ab - ma * mb) + 9e-4) /
               ((ma * ma + mb * mb + 1e-4) * (aa + bb - ma * ma - mb * mb + 9e-4));
      }
    }
  }
  return sum / (a.channels * (a.width - 10) * (a.height - 10));
}

TEST(Metrics, SsimIsTheSameForAnyThreads) {
  const Planes a = ToPlanes(Noise(23, 150, 1)), b = ToPlanes(Noise(23, 150, 2, 0, 90));
  const double one = *Ssim(a, b);
  EXPECT_EQ(*Ssim(a, b, SsimBorder::kValid, 3), one);
  EXPECT_EQ(*Ssim(a, b, SsimBorder::kZero, 3), *Ssim(a, b, SsimBorder::kZero));
  EXPECT_NEAR(one, SsimOfDefinition(a, b), 1e-12);
}

TEST(Metrics, SsimNeedsOneWholeWindow) {
  EXPECT_TRUE(Ssim(Noise(11, 11, 1), Noise(11, 11, 2)).ok());
  const auto small = Ssim(Noise(10, 40, 1), Noise(10, 40, 2));
  ASSERT_FALSE(small.ok());
  EXPECT_EQ(GetErrorDetail(small.status())->reason, "IMAGE_TOO_SMALL");
  EXPECT_TRUE(Ssim(Noise(10, 40, 1), Noise(10, 40, 2), SsimBorder::kZero).ok());
}

// The part of `image` from column `first` on.
ImageU8 RightOf(const ImageU8& image, int first) {
  ImageU8 part(image.width - first, image.height);
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      std::copy_n(image.pixel(first + x, y), 3, part.pixel(x, y));
    }
  }
  return part;
}

TEST(Metrics, WhatDoesNotCountIsTakenAsEqualAndInNoMean) {
  const ImageU8 a = Noise(60, 40, 1), b = Noise(60, 40, 2);
  const int hidden = 15;
  PlaneU8 mask(60, 40);
  ImageU8 filled = b;
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 60; ++x) {
      mask.data[size_t(y) * 60 + x] = x < hidden ? 0 : kCounts;
      if (x < hidden) std::copy_n(a.pixel(x, y), 3, filled.pixel(x, y));
    }
  }
  EXPECT_NEAR(*Psnr(a, b, mask), *Psnr(RightOf(a, hidden), RightOf(b, hidden)), 1e-9);
  // Its valid windows are those of the pixels that count.
  EXPECT_NEAR(*Ssim(a, b, SsimBorder::kValid, mask),
              *Ssim(RightOf(a, hidden - 5), RightOf(filled, hidden - 5)), 1e-9);
  ColorFitter masked, cropped;
  ASSERT_TRUE(masked.Add(a, b, mask).ok());
  ASSERT_TRUE(cropped.Add(RightOf(a, hidden), RightOf(b, hidden)).ok());
  for (int i = 0; i < 12; ++i) EXPECT_NEAR(masked.Fit()->m[i], cropped.Fit()->m[i], 1e-9);
  EXPECT_EQ(GetErrorDetail(Psnr(a, b, PlaneU8(9, 9)).status())->reason, "SIZE_MISMATCH");
  EXPECT_EQ(GetErrorDetail(Psnr(a, b, PlaneU8(60, 40)).status())->reason, "MASK_BLACK");
  EXPECT_EQ(GetErrorDetail(Ssim(a, b, SsimBorder::kValid, PlaneU8(60, 40)).status())->reason,
            "IMAGE_TOO_SMALL");
}

TEST(Metrics, DifferentSizesAndEmptyImagesAreErrors) {
  const auto mismatch = Psnr(Noise(20, 30, 1), Noise(30, 20, 1));
  ASSERT_FALSE(mismatch.ok());
  EXPECT_EQ(mismatch.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(GetErrorDetail(mismatch.status())->reason, "SIZE_MISMATCH");
  EXPECT_EQ(GetErrorDetail(Ssim(ImageU8(), ImageU8()).status())->reason, "EMPTY_IMAGE");
}

TEST(ColorFitter, FindsTheAffineMapThatMadeTheTruth) {
  ColorFit truth;
  truth.m = {0.8, 0.1, 0.0, 0.02, 0.05, 0.7, 0.1, 0.05, -0.1, 0.1, 0.9, 0.03};
  ColorFitter fitter;
  for (int i = 0; i < 2; ++i) {
    const Planes render = ToPlanes(Noise(25, 17, i, 40, 220));  // mapped without clipping
    ASSERT_TRUE(fitter.Add(render, truth.Apply(render)).ok());
  }
  const auto fit = fitter.Fit();
  ASSERT_TRUE(fit.ok());
  for (int i = 0; i < 12; ++i) EXPECT_NEAR(fit->m[i], truth.m[i], 1e-5) << i;  // float images
}

TEST(ColorFitter, AGreySceneKeepsItsMissingDirections) {
  Planes grey(3, 8, 8), brighter(3, 8, 8);
  const CounterRng rng(1, 1);
  for (size_t i = 0; i < 64; ++i) {
    const float v = static_cast<float>(0.5 * rng.Uniform(i));
    for (int c = 0; c < 3; ++c) grey.plane(c)[i] = v, brighter.plane(c)[i] = 1.5f * v + 0.1f;
  }
  ColorFitter fitter;
  ASSERT_TRUE(fitter.Add(grey, brighter).ok());
  const auto fit = fitter.Fit();
  ASSERT_TRUE(fit.ok());
  EXPECT_GT(*Psnr(fit->Apply(grey), brighter), 80);
  for (const double m : fit->m) EXPECT_LT(std::abs(m), 2);
}

TEST(ColorFitter, WithoutImagesThereIsNoFit) {
  EXPECT_EQ(ColorFitter().Fit().status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(AffineCorrectedPsnr, RemovesAToneErrorButNotStructure) {
  std::vector<ImageU8> renders, darker, unrelated;
  for (int i = 0; i < 3; ++i) {
    renders.push_back(Noise(32, 24, i));
    ImageU8 dark = renders.back();
    for (uint8_t& v : dark.data) v = v / 2 + 10;
    darker.push_back(dark);
    unrelated.push_back(Noise(32, 24, 100 + i));
  }
  const auto tone = AffineCorrectedPsnr(renders, darker);
  ASSERT_TRUE(tone.ok());
  EXPECT_LT(*Psnr(renders[0], darker[0]), 15);
  EXPECT_GT(tone->corrected_db, 50);  // what is left is rounding to bytes
  const auto structure = AffineCorrectedPsnr(renders, unrelated);
  ASSERT_TRUE(structure.ok());
  EXPECT_LT(structure->corrected_db, 12);  // uniform noise of deviation 0.29: 10.8 dB at best
}

TEST(AffineCorrectedPsnr, NeedsPairs) {
  EXPECT_EQ(GetErrorDetail(AffineCorrectedPsnr({Noise(8, 8, 1)}, {}).status())->reason,
            "COUNT_MISMATCH");
  EXPECT_FALSE(AffineCorrectedPsnr({}, {}).ok());
}

}  // namespace
}  // namespace litags
