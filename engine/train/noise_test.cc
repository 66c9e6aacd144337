#include "engine/train/noise.h"

#include <gtest/gtest.h>

#include <vector>

#include "engine/core/rng.h"

namespace litags {
namespace {

// Photos of 160x100 of middle grey, with noise of a normal distribution that squares of
// `side` pixels share.
std::vector<TrainView> NoisyViews(double deviation, int side = 1) {
  std::vector<TrainView> out(3);
  for (size_t i = 0; i < out.size(); ++i) {
    TrainView& view = out[i];
    view.view.camera.width = 160;
    view.view.camera.height = 100;
    view.photo = view.target = Photo(160, 100);
    const CounterRng rng(5, i);
    for (int y = 0; y < 100; ++y) {
      for (int x = 0; x < 160; ++x) {
        const int square = (y / side) * 160 + x / side;
        for (int c = 0; c < 3; ++c) {
          const double code = 120 + deviation * rng.Normal(3 * square + c);
          view.target.pixel(x, y)[c] = PhotoSample(code / 255);
        }
      }
    }
  }
  return out;
}

TEST(Noise, IsMeasuredInAllTargets) {
  for (const double deviation : {4, 12, 30}) {
    const TargetNoise have = MeasureNoise(NoisyViews(deviation), 2);
    EXPECT_NEAR(have.fine, deviation, 0.1 * deviation);
    EXPECT_NEAR(have.white, deviation, 0.1 * deviation);
  }
  EXPECT_EQ(MeasureNoise(NoisyViews(0), 2).fine, 0);
  EXPECT_EQ(MeasureNoise({}, 2).fine, 0);
}

TEST(Noise, WhatIsAsMuchInSmallerPicturesIsTexture) {
  const TargetNoise have = MeasureNoise(NoisyViews(12, 2), 2);
  EXPECT_GT(have.fine, 4);
  EXPECT_EQ(have.white, 0);
}

TEST(Noise, DropoutGrowsAndSsimFallsWithIt) {
  Recipe recipe;
  recipe.dropout = 0.4;
  recipe.exposure_ssim = 0.2;
  EXPECT_EQ(AdaptToNoise(recipe, {0, 0}).dropout, 0);
  EXPECT_DOUBLE_EQ(AdaptToNoise(recipe, {2, 0}).dropout, 0.2);
  EXPECT_NEAR(AdaptToNoise(recipe, {100, 0}).dropout, 0.4, 0.001);
  EXPECT_NEAR(AdaptToNoise(recipe, {100, 4}).dropout, 0.6, 0.001);
  EXPECT_NEAR(AdaptToNoise(recipe, {100, 100}).dropout, 0.8, 0.002);
  EXPECT_EQ(AdaptToNoise(recipe, {100, 4}).exposure_ssim, 0.2);
  EXPECT_DOUBLE_EQ(AdaptToNoise(recipe, {100, 8}).exposure_ssim, 0.1);
  recipe.dropout = 0.6;
  EXPECT_EQ(AdaptToNoise(recipe, {100, 100}).dropout, 0.9) << "the most there is";
  recipe.lita = false;
  EXPECT_EQ(AdaptToNoise(recipe, {100, 8}).exposure_ssim, 0.2);
  EXPECT_EQ(AdaptToNoise(recipe, {100, 8}).dropout, 0.6);
}

}  // namespace
}  // namespace litags
