#include "engine/target/bilateral.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/mask.h"
#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"

namespace litags {
namespace {

constexpr float kPerRange = 3;  // most guides are alike in part

FloatImage Random(int width, int height, uint64_t seed) {
  const CounterRng rng(seed, 0);
  FloatImage image(height, width);
  for (int i = 0; i < width * height; ++i) {
    for (int c = 0; c < 3; ++c) image(i)[c] = static_cast<float>(rng.Uniform(3 * i + c));
  }
  return image;
}

cv::Vec3f Definition(const FloatImage& image, const FloatImage& guide, const PlaneU8& mask, int x,
                     int y) {
  const auto weight = [](int taps) {
    return static_cast<float>(
        std::exp(-0.5 * std::pow(taps * kBilateralSpacing / kBilateralSigma, 2)));
  };
  cv::Vec3f sum(0, 0, 0);
  float total = 0;
  for (int j = -kBilateralTaps; j <= kBilateralTaps; ++j) {
    for (int i = -kBilateralTaps; i <= kBilateralTaps; ++i) {
      const int u = std::clamp(x + i * kBilateralSpacing, 0, image.cols - 1);
      const int v = std::clamp(y + j * kBilateralSpacing, 0, image.rows - 1);
      if (!Counts(mask, u, v) && (i != 0 || j != 0)) continue;
      const cv::Vec3f d = guide(v, u) - guide(y, x);
      const float square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      const float near = std::max(0.0f, 1 - square * kPerRange);
      const float w = near * near * near * weight(j) * weight(i);
      for (int c = 0; c < 3; ++c) sum[c] += w * image(v, u)[c];
      total += w;
    }
  }
  return sum * (1 / total);
}

void ExpectItsDefinition(int width, int height, const PlaneU8& mask) {
  const FloatImage image = Random(width, height, 1), guide = Random(width, height, 2);
  BilateralFilter filter(image, guide, mask, kPerRange);
  for (int y = 0; y < height; ++y) {
    const auto& means = filter.Row(y);
    for (int x = 0; x < width; ++x) {
      const cv::Vec3f expected = Definition(image, guide, mask, x, y);
      for (int c = 0; c < 3; ++c) ASSERT_EQ(means[c][x], expected[c]) << x << " " << y;
    }
  }
}

TEST(BilateralFilter, IsItsDefinitionToTheLastBitOnEveryTarget) {
  for (const int width : {1, 7, 16, 17, 33}) {
    ForEachTarget([&] { ExpectItsDefinition(width, 11, PlaneU8()); });
  }
}

TEST(BilateralFilter, WhatIsMaskedCountsAtItsOwnPixelOnly) {
  PlaneU8 mask(19, 13);
  const CounterRng rng(3, 0);
  for (size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = rng.Uniform(i) < 0.5 ? kCounts : 0;
  ForEachTarget([&] { ExpectItsDefinition(19, 13, mask); });
}

}  // namespace
}  // namespace litags
