#include "engine/train/depth_loss.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/train/loss_test_util.h"

namespace litags {
namespace {

// 1 - PCC of one region by its definition, in two passes.
double Oracle(const std::vector<double>& a, const Planes& b, const Planes& w, const PixelRect& p) {
  const auto weight = [&](size_t i) { return w.empty() ? 1.0 : double(w.data[i]); };
  std::vector<size_t> pixels;
  for (int y = p.y; y < p.y + p.height; ++y) {
    for (int x = p.x; x < p.x + p.width; ++x) pixels.push_back(size_t(y) * b.width + x);
  }
  double sw = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
  for (const size_t i : pixels)
    sw += weight(i), sa += weight(i) * a[i], sb += weight(i) * b.data[i];
  for (const size_t i : pixels) {
    const double da = a[i] - sa / sw, db = b.data[i] - sb / sw;
    aa += weight(i) * da * da, bb += weight(i) * db * db, ab += weight(i) * da * db;
  }
  return 1 - ab / std::sqrt(aa * bb);
}

double OracleSum(const std::vector<double>& a, const Planes& b, const Planes& w,
                 const std::vector<PixelRect>& patches) {
  double loss = Oracle(a, b, w, {0, 0, b.width, b.height});
  for (const PixelRect& p : patches) loss += Oracle(a, b, w, p) / patches.size();
  return loss;
}

const std::vector<PixelRect> kPatches = {{0, 0, 7, 9}, {3, 2, 7, 9}, {9, 12, 8, 5}};

TEST(DepthLoss, GradientsMatchFiniteDifferencesOfTheOracle) {
  const Planes a = RandomPlanes(1, 17, 19, 1), b = RandomPlanes(1, 17, 19, 2);
  LossWorkspace ws(2);
  for (const Planes& w : {Planes(), RandomPlanes(1, 17, 19, 3)}) {
    Planes v(1, 17, 19);
    const PlanesView confidence = w.empty() ? PlanesView() : PlanesView(w);
    const double value = DepthLoss(a, b, confidence, kPatches, 0.3, v, ws).Sum();
    const std::vector<double> at(a.data.begin(), a.data.end());
    EXPECT_NEAR(value, 0.3 * OracleSum(at, b, w, kPatches), 1e-9);  // sums are double throughout
    std::vector<double> expected(at.size());
    constexpr double kStep = 1e-5;
    for (size_t i = 0; i < at.size(); ++i) {
      std::vector<double> above = at, below = at;
      above[i] += kStep, below[i] -= kStep;
      expected[i] =
          0.3 * (OracleSum(above, b, w, kPatches) - OracleSum(below, b, w, kPatches)) / (2 * kStep);
    }
    ExpectGradientsNear(v.data, expected, 1e-5, "depth");
  }
}

TEST(DepthLoss, IsBlindToScaleAndOffsetOfTheTarget) {
  const Planes a = RandomPlanes(1, 40, 50, 1), b = RandomPlanes(1, 40, 50, 2);
  Planes scaled = b;
  for (float& d : scaled.data) d = 3 * d + 500;
  LossWorkspace ws(1);
  // The offset costs float digits of the target itself: 500 * 2^-24 of a range of 2.7.
  EXPECT_NEAR(DepthLoss(a, b, {}, kPatches, 1, {}, ws).Sum(),
              DepthLoss(a, scaled, {}, kPatches, 1, {}, ws).Sum(), 1e-4);
  EXPECT_NEAR(DepthLoss(b, scaled, {}, kPatches, 1, {}, ws).Sum(), 0, 1e-6);
}

TEST(DepthLoss, PixelsWithoutConfidenceDoNotCount) {
  const Planes a = RandomPlanes(1, 20, 30, 1), b = RandomPlanes(1, 20, 30, 2);
  Planes hole = b, w(1, 20, 30);
  std::fill(w.data.begin(), w.data.end(), 1.0f);
  for (int x = 5; x < 12; ++x) hole.at(0, 7, x) = 1e6f, w.at(0, 7, x) = 0;
  Planes zeroed = b;
  for (int x = 5; x < 12; ++x) zeroed.at(0, 7, x) = 0;
  LossWorkspace ws(2);
  Planes v(1, 20, 30);
  EXPECT_EQ(DepthLoss(a, hole, w, kPatches, 1, v, ws).Sum(),
            DepthLoss(a, zeroed, w, kPatches, 1, {}, ws).Sum());
  for (int x = 5; x < 12; ++x) EXPECT_EQ(v.at(0, 7, x), 0);
}

TEST(DepthLoss, AConstantMapHasNoCorrelationAndNoGradient) {
  const Planes b = RandomPlanes(1, 20, 30, 2);
  LossWorkspace ws(1);
  for (const float constant : {0.0f, 0.1f, 1e4f}) {
    Planes flat(1, 20, 30), v(1, 20, 30);
    std::fill(flat.data.begin(), flat.data.end(), constant);
    const DepthLossTerms terms = DepthLoss(flat, b, {}, kPatches, 1, v, ws);
    EXPECT_EQ(terms.global, 1);
    EXPECT_NEAR(terms.local, 1, 1e-15);
    EXPECT_TRUE(std::all_of(v.data.begin(), v.data.end(), [](float g) { return g == 0; }));
  }
}

TEST(DepthLoss, ResultsAreTheSameBytesForAnyNumberOfThreads) {
  const Planes a = RandomPlanes(1, 203, 301, 1), b = RandomPlanes(1, 203, 301, 2);
  const auto patches = DrawDepthPatches(301, 203, 1, 2);
  LossWorkspace one(1);
  Planes v(1, 203, 301);
  const DepthLossTerms terms = DepthLoss(a, b, {}, patches, 1, v, one);
  for (const int threads : {2, 5}) {
    LossWorkspace many(threads);
    Planes w(1, 203, 301);
    EXPECT_EQ(DepthLoss(a, b, {}, patches, 1, w, many).Sum(), terms.Sum());
    EXPECT_EQ(w.data, v.data);
  }
}

TEST(DrawDepthPatches, AreHalfTheGridInsideTheImageAndNewEveryIteration) {
  bool moved = false;
  PixelRect first;
  for (int iteration = 0; iteration < 200; ++iteration) {
    const auto patches = DrawDepthPatches(500, 375, 9, iteration);
    ASSERT_EQ(patches.size(), 3u);  // half of floor(500 / 128) * floor(375 / 128) = 6
    for (const PixelRect& p : patches) {
      ASSERT_GE(p.x, 0);
      ASSERT_GE(p.y, 0);
      ASSERT_LE(p.x + p.width, 500);
      ASSERT_LE(p.y + p.height, 375);
    }
    if (iteration == 0) first = patches[0];
    moved |= patches[0].x != first.x || patches[0].y != first.y;
  }
  EXPECT_TRUE(moved);
  const auto again = DrawDepthPatches(500, 375, 9, 0);
  EXPECT_EQ(again[0].x, first.x);
  EXPECT_EQ(again[0].y, first.y);
}

TEST(DrawDepthPatches, ShrinkToASmallImage) {
  const auto patches = DrawDepthPatches(100, 300, 1, 1);
  ASSERT_EQ(patches.size(), 1u);  // half of 1 * 2 cells
  EXPECT_EQ(patches[0].width, 100);
  EXPECT_EQ(patches[0].height, 128);
}

}  // namespace
}  // namespace litags
