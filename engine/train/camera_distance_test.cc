#include "engine/train/camera_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// `n` Gaussians of scale 1 with means at x = 0 .. n - 1.
Splats Line(size_t n) {
  Splats splats(n);
  for (size_t i = 0; i < n; ++i) splats.at(i, kMean) = static_cast<float>(i);
  return splats;
}

TEST(PruneNearCameras, HidesWhatIsNearerAndNothingElse) {
  Splats splats = Line(40);
  const Splats before = splats;
  const std::array<double, 3> centers[] = {{-1, 0, 0}, {35, 0, 0}};
  PruneNearCameras(1.5, centers, 2, &splats);
  for (int i = 0; i < 40; ++i) {
    for (int row = 0; row < kSplatRows; ++row) {
      const bool hidden = row == kLogitOpacity && (i == 0 || (i >= 34 && i <= 36));
      ASSERT_EQ(splats.at(i, row) != before.at(i, row), hidden) << i << " row " << row;
    }
  }
  EXPECT_LT(splats.at(0, kLogitOpacity), std::log(kAlphaMin));
}

TEST(DistanceQuantile, IsThatOfTheNearestCamera) {
  const Splats splats = Line(200);
  const std::array<double, 3> centers[] = {{-5, 0, 0}};
  EXPECT_DOUBLE_EQ(DistanceQuantile(0, centers, 2, splats), 5);
  EXPECT_NEAR(DistanceQuantile(0.01, centers, 2, splats), 7, 1.001);
  EXPECT_DOUBLE_EQ(DistanceQuantile(0.5, centers, 2, splats), 105);
  EXPECT_EQ(DistanceQuantile(0.01, centers, 2, Splats()), 0);
}

// One pair after the other, in double precision.
double ToNearest(Centers centers, const Splats& splats, size_t i) {
  double nearest = INFINITY;
  for (const auto& p : centers) {
    nearest =
        std::min(nearest, std::hypot(p[0] - splats.at(i, kMean), p[1] - splats.at(i, kMean + 1),
                                     p[2] - splats.at(i, kMean + 2)));
  }
  return nearest;
}

TEST(DistanceQuantile, IsThatOfAllPairsOnEveryInstructionSet) {
  const CounterRng rng(4, 1);
  uint64_t counter = 0;
  const auto place = [&] { return 6 * rng.Uniform(counter++) - 3; };
  for (const size_t count : {1, 15, 16, 17, 100}) {
    Splats splats(count);
    for (size_t i = 0; i < count; ++i) {
      for (int k = 0; k < 3; ++k) splats.at(i, kMean + k) = static_cast<float>(place());
    }
    std::vector<std::array<double, 3>> centers;
    while (centers.size() < count) centers.push_back({place(), place(), place()});
    centers.push_back(centers[0]);  // two photos of one place
    std::vector<double> want;
    for (size_t i = 0; i < count; ++i) want.push_back(ToNearest(centers, splats, i));
    std::sort(want.begin(), want.end());
    ForEachTarget([&] {
      for (const double q : {0.0, 0.3, 0.99}) {
        const auto at = static_cast<size_t>(q * static_cast<double>(count));
        // Places are rounded to 2^-24 of 3.
        EXPECT_NEAR(DistanceQuantile(q, centers, 2, splats), want[at], 2e-6) << count << " " << q;
      }
    });
  }
}

TEST(LimitScales, CutsWhatIsWiderThanItsDistanceAllows) {
  Splats splats = Line(40);
  splats.at(3, kLogScale + 1) = std::log(7.0f);
  const Splats before = splats;
  const std::array<double, 3> centers[] = {{-1, 0, 0}, {35, 0, 0}};
  LimitScales(0.5, centers, 2, &splats);
  // Half the distance is less than 1 at x = 0 and around 35, and 2 at x = 3.
  Splats want = before;
  for (int k = 0; k < 3; ++k) {
    for (const int i : {0, 34, 36}) want.at(i, kLogScale + k) = std::log(0.5f);
    want.at(35, kLogScale + k) = std::log(0.5e-7f);
  }
  want.at(3, kLogScale + 1) = std::log(2.0f);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int row = 0; row < kSplatRows; ++row) {
      ASSERT_NEAR(splats.at(i, row), want.at(i, row), 1e-5) << i << " row " << row;
    }
  }
}

}  // namespace
}  // namespace litags
