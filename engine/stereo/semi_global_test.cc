#include "engine/stereo/semi_global.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"

namespace litags {
namespace {

// The recursion of the paper along one direction, by memory of every pixel.
void AddDirection(const CostVolume& v, const std::vector<float>& gray, const SmoothnessPenalty& p,
                  int dx, int dy, std::vector<int>* sums) {
  std::vector<int> path(v.cost.size());
  for (int j = 0; j < v.height; ++j) {
    for (int i = 0; i < v.width; ++i) {
      const int x = dx < 0 ? v.width - 1 - i : i, y = dy < 0 ? v.height - 1 - j : j;
      const int bx = x - dx, by = y - dy;
      const size_t pixel = size_t(y) * v.width + x, before = size_t(by) * v.width + bx;
      const bool first = bx < 0 || by < 0 || bx >= v.width || by >= v.height;
      for (int d = 0; d < v.labels; ++d) {
        int& now = path[pixel * v.labels + d];
        now = v.cost[pixel * v.labels + d];
        if (!first) {
          const int* last = &path[before * v.labels];
          const int least = *std::min_element(last, last + v.labels);
          const float edge = std::abs(gray[pixel] - gray[before]);
          const float contrast = static_cast<float>(p.edge_contrast);
          const int jump =
              std::max(p.step, static_cast<int>(p.jump * contrast / (contrast + edge)));
          int best = std::min(last[d], least + jump);
          if (d > 0) best = std::min(best, last[d - 1] + p.step);
          if (d + 1 < v.labels) best = std::min(best, last[d + 1] + p.step);
          now += best - least;
        }
        (*sums)[pixel * v.labels + d] += now;
      }
    }
  }
}

TEST(AggregateCosts, FollowsTheRecursionOnEveryTarget) {
  const CounterRng rng(1, 0);
  CostVolume volume(13, 9, 20);
  ASSERT_EQ(volume.labels, 32);
  uint64_t counter = 0;
  std::vector<float> gray(13 * 9);
  for (size_t i = 0; i < gray.size(); ++i) {
    gray[i] = static_cast<float>(rng.Uniform(counter++));
    for (int d = 0; d < 20; ++d) volume.at(i)[d] = static_cast<uint8_t>(rng.Below(counter++, 256));
  }
  SmoothnessPenalty penalty;
  penalty.step = 20;
  penalty.jump = 300;
  penalty.edge_contrast = 0.2;
  std::vector<int> expected(volume.cost.size());
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (dx != 0 || dy != 0) AddDirection(volume, gray, penalty, dx, dy, &expected);
    }
  }
  ForEachTarget([&] {
    const std::vector<uint16_t> sums = AggregateCosts(volume, gray.data(), penalty);
    ASSERT_EQ(std::vector<int>(sums.begin(), sums.end()), expected);
  });
}

TEST(AggregateCosts, PixelsThatKnowNothingTakeTheirNeighboursLabel) {
  CostVolume volume(9, 1, 16);
  for (int x = 0; x < 9; ++x) {
    for (int d = 0; d < 16; ++d) volume.at(x)[d] = 100;
  }
  volume.at(0)[5] = volume.at(8)[5] = 0;
  SmoothnessPenalty penalty;
  penalty.step = 10;
  penalty.jump = 50;
  penalty.edge_contrast = 1;
  const std::vector<float> gray(9, 0.0f);
  const std::vector<uint16_t> sums = AggregateCosts(volume, gray.data(), penalty);
  for (int x = 0; x < 9; ++x) {
    const uint16_t* sum = &sums[x * volume.labels];
    EXPECT_EQ(std::min_element(sum, sum + 16) - sum, 5) << x;
  }
}

}  // namespace
}  // namespace litags
