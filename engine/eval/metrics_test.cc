#include "engine/eval/metrics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/error.h"
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

TEST(Metrics, SsimNeedsOneWholeWindow) {
  EXPECT_TRUE(Ssim(Noise(11, 11, 1), Noise(11, 11, 2)).ok());
  const auto small = Ssim(Noise(10, 40, 1), Noise(10, 40, 2));
  ASSERT_FALSE(small.ok());
  EXPECT_EQ(GetErrorDetail(small.status())->reason, "IMAGE_TOO_SMALL");
  EXPECT_TRUE(Ssim(Noise(10, 40, 1), Noise(10, 40, 2), SsimBorder::kZero).ok());
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
