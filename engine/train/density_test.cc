#include "engine/train/density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "engine/train/train_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr double kExtent = 10;  // with densify_percent 0.01: clone up to 0.1, split above

// `n` Gaussians of scale `scale`, apart on a line, with moments that tell them apart.
SplatState Line(size_t n, double scale) {
  SplatState state;
  state.params = Splats(n);
  state.moment1 = Splats(n);
  state.moment2 = Splats(n);
  for (size_t i = 0; i < n; ++i) {
    state.params.at(i, kMean) = static_cast<float>(i);
    for (int k = 0; k < 3; ++k)
      state.params.at(i, kLogScale + k) = static_cast<float>(std::log(scale));
    state.params.at(i, kRawQuat) = 1;
    state.params.at(i, kShDc) = static_cast<float>(i);  // who it was
    for (int row = 0; row < kSplatRows; ++row) {
      state.moment1.at(i, row) = static_cast<float>(i + 1);
      state.moment2.at(i, row) = static_cast<float>(100 + i);
    }
  }
  return state;
}

DensityStats Stats(std::vector<float> mean_grads) {
  DensityStats stats;
  stats.Reset(mean_grads.size());
  for (size_t i = 0; i < mean_grads.size(); ++i) {
    stats.views[i] = 4;
    stats.grad[i] = 4 * mean_grads[i];
  }
  return stats;
}

// Identities (see Line) present in `state`, with repeats.
std::multiset<int> Identities(const SplatState& state) {
  std::multiset<int> ids;
  for (size_t i = 0; i < state.params.size(); ++i) ids.insert(int(state.params.at(i, kShDc)));
  return ids;
}

TEST(Density, ClonesSmallGaussiansThatMove) {
  SplatState state = Line(5, 0.05);
  DensityStats stats = Stats({0, 1e-3f, 0, 1e-3f, 1e-4f});
  ControlDensity(TrainOptions(), kExtent, 600, &state, &stats);
  EXPECT_EQ(Identities(state), (std::multiset<int>{0, 1, 1, 2, 3, 3, 4}));
  EXPECT_EQ(stats.grad, std::vector<float>(7, 0.0f));
  EXPECT_EQ(stats.views, std::vector<float>(7, 0.0f));
  // Of each pair one keeps its moments and the new one starts without.
  for (const int id : {1, 3}) {
    float sum = 0;
    for (size_t i = 0; i < 7; ++i) {
      if (int(state.params.at(i, kShDc)) != id) continue;
      EXPECT_EQ(state.params.at(i, kMean), float(id)) << "a clone stays in place";
      sum += state.moment1.at(i, kLogitOpacity);
    }
    EXPECT_EQ(sum, float(id + 1));
  }
}

TEST(Density, SplitsLargeGaussiansInTwoSmallerOnes) {
  SplatState state = Line(400, 0.5);
  DensityStats stats = Stats(std::vector<float>(400, 1e-3f));
  ControlDensity(TrainOptions(), kExtent, 600, &state, &stats);
  ASSERT_EQ(state.params.size(), 800u);
  double sum = 0, sum2 = 0;
  for (size_t i = 0; i < 800; ++i) {
    EXPECT_NEAR(state.params.at(i, kLogScale + 1), std::log(0.5 / 1.6), 1e-6);
    EXPECT_EQ(state.moment1.at(i, kMean), 0);
    EXPECT_EQ(state.moment2.at(i, kShRest), 0);
    const double offset = state.params.at(i, kMean + 1);
    sum += offset;
    sum2 += offset * offset;
  }
  // Offsets are normal with the parent's deviation; 800 of them, so 3.5 standard errors.
  EXPECT_NEAR(sum / 800, 0, 3.5 * 0.5 / std::sqrt(800.0));
  EXPECT_NEAR(std::sqrt(sum2 / 800), 0.5, 3.5 * 0.5 / std::sqrt(2 * 800.0));
}

TEST(Density, SplitsAlongTheGaussiansOwnAxes) {
  SplatState state = Line(200, 0.5);
  for (size_t i = 0; i < 200; ++i) {
    state.params.at(i, kMean) = 0;
    state.params.at(i, kLogScale + 1) = state.params.at(i, kLogScale + 2) = std::log(1e-4f);
    // Turned 90 degrees about z (and not normalised): its long axis is the world's y.
    state.params.at(i, kRawQuat) = state.params.at(i, kRawQuat + 3) = 3;
  }
  DensityStats stats = Stats(std::vector<float>(200, 1e-3f));
  ControlDensity(TrainOptions(), kExtent, 600, &state, &stats);
  double across = 0, along = 0;
  for (size_t i = 0; i < state.params.size(); ++i) {
    across = std::max<double>(across, std::abs(state.params.at(i, kMean)));
    along = std::max<double>(along, std::abs(state.params.at(i, kMean + 1)));
  }
  EXPECT_LT(across, 1e-3);
  EXPECT_GT(along, 0.5);
}

TEST(Density, HalvesLieSideBySideOnTheLongestAxis) {
  for (const double scale : {0.05, 0.5}) {  // 3DGS would clone one and split the other
    SplatState state = Line(2, 1e-4);
    for (size_t i = 0; i < 2; ++i) {
      state.params.at(i, kMean) = 0;
      // Turned 90 degrees about z (and not normalised): its long axis is the world's y.
      state.params.at(i, kLogScale) = static_cast<float>(std::log(scale));
      state.params.at(i, kRawQuat) = state.params.at(i, kRawQuat + 3) = 3;
      state.params.at(i, kLogitOpacity) = 0;
    }
    DensityStats stats = Stats({1e-3f, 0});
    TrainOptions options;
    options.recipe.growth = Growth::kLongAxis;
    ControlDensity(options, kExtent, 600, &state, &stats);
    ASSERT_EQ(state.params.size(), 3u);
    double sum = 0, variance = 0;
    for (size_t i = 0; i < 3; ++i) {
      const Splats& s = state.params;
      if (s.at(i, kShDc) == 1) {  // the other one is as it was
        EXPECT_EQ(s.at(i, kLogScale), static_cast<float>(std::log(scale)));
        EXPECT_EQ(state.moment1.at(i, kMean), 2);
        continue;
      }
      EXPECT_NEAR(s.at(i, kMean), 0, 1e-6);
      EXPECT_NEAR(s.at(i, kMean + 2), 0, 1e-6);
      EXPECT_NEAR(s.at(i, kLogScale + 1), std::log(0.9e-4), 1e-5);
      EXPECT_NEAR(s.at(i, kLogitOpacity), std::log(0.4 / 0.6), 1e-5);
      EXPECT_EQ(state.moment1.at(i, kMean), 0);
      EXPECT_EQ(state.moment2.at(i, kShRest), 0);
      const double offset = s.at(i, kMean + 1);
      sum += offset;
      variance += (offset * offset + std::exp(2 * s.at(i, kLogScale))) / 2;
    }
    EXPECT_NEAR(sum, 0, 1e-6);
    EXPECT_NEAR(std::sqrt(variance), scale, 1e-5 * scale) << "as far out as the whole";
  }
}

TEST(Density, HalvesChangeThePictureLessThanCopiesAndRandomPlaces) {
  const Camera camera = RingCamera(0, 1, 64, 48);
  const auto render = [&](const Splats& splats) {
    Renderer renderer;
    Planes image, alpha;
    renderer.Forward(splats, camera, RenderSettings(), &image, &alpha);
    return image;
  };
  const Splats cloud = ColoredCloud(300, 4);
  const Planes before = render(cloud);
  const auto change = [&](Growth growth, double extent) {
    SplatState state{cloud, Splats(300), Splats(300)};
    DensityStats stats = Stats(std::vector<float>(300, 1e-3f));
    TrainOptions options;
    options.recipe.growth = growth;
    ControlDensity(options, extent, 600, &state, &stats);
    const Planes after = render(state.params);
    double sum = 0;
    for (size_t i = 0; i < 3 * before.plane_size(); ++i) {
      sum += std::abs(after.data[i] - before.data[i]);
    }
    return sum;
  };
  constexpr double kAllSmall = 1000, kAllLarge = 1;
  const double halves = change(Growth::kLongAxis, kAllSmall);
  EXPECT_EQ(change(Growth::kLongAxis, kAllLarge), halves) << "size does not matter";
  EXPECT_LT(halves, 0.8 * change(Growth::kCloneSplit, kAllSmall));
  EXPECT_LT(halves, 0.8 * change(Growth::kCloneSplit, kAllLarge));
}

TEST(Density, TheBudgetGoesToTheStrongest) {
  SplatState state = Line(10, 0.05);
  DensityStats stats =
      Stats({3e-3f, 9e-3f, 1e-3f, 8e-3f, 2e-3f, 7e-3f, 5e-3f, 5e-3f, 4e-3f, 6e-3f});
  TrainOptions options;
  options.max_gaussians = 13;
  ControlDensity(options, kExtent, 600, &state, &stats);
  EXPECT_EQ(state.params.size(), 13u);
  const std::multiset<int> ids = Identities(state);
  for (const int id : {1, 3, 5}) EXPECT_EQ(ids.count(id), 2u) << id;
}

TEST(Density, AFullSceneDoesNotGrow) {
  SplatState state = Line(10, 0.05);
  DensityStats stats = Stats(std::vector<float>(10, 1.0f));
  TrainOptions options;
  options.max_gaussians = 4;
  ControlDensity(options, kExtent, 600, &state, &stats);
  EXPECT_EQ(state.params.size(), 10u);
}

TEST(Density, PrunesTheTransparentAndWhatIsNotANumber) {
  SplatState state = Line(6, 0.05);
  state.params.at(1, kLogitOpacity) = std::log(0.004f / 0.996f);
  state.params.at(2, kLogitOpacity) = std::log(0.006f / 0.994f);
  state.params.at(3, kLogitOpacity) = std::numeric_limits<float>::quiet_NaN();
  state.params.at(4, kMean + 1) = std::numeric_limits<float>::quiet_NaN();
  state.params.at(5, kLogScale) = std::numeric_limits<float>::infinity();
  DensityStats stats = Stats(std::vector<float>(6, std::numeric_limits<float>::quiet_NaN()));
  ControlDensity(TrainOptions(), kExtent, 600, &state, &stats);
  EXPECT_EQ(Identities(state), (std::multiset<int>{0, 2}));
  EXPECT_EQ(state.moment2.size(), 2u);
  EXPECT_EQ(stats.grad.size(), 2u);
}

TEST(Density, NeverEmptiesTheScene) {
  SplatState state = Line(3, 0.05);
  for (size_t i = 0; i < 3; ++i) state.params.at(i, kLogitOpacity) = -20;
  DensityStats stats = Stats({0, 0, 0});
  ControlDensity(TrainOptions(), kExtent, 600, &state, &stats);
  EXPECT_EQ(state.params.size(), 1u);
}

TEST(Density, TheOneThatStaysIsTheMostOpaqueThatIsFinite) {
  SplatState state = Line(5, 0.05);
  for (size_t i = 0; i < 5; ++i) {
    state.params.at(i, kLogitOpacity) = -20 + static_cast<float>(i % 4);
  }
  state.params.at(0, kMean) = std::numeric_limits<float>::quiet_NaN();
  state.params.at(3, kShDc + 1) = std::numeric_limits<float>::infinity();
  DensityStats stats = Stats({0, 0, 0, 0, 0});
  ControlDensity(TrainOptions(), kExtent, 600, &state, &stats);
  EXPECT_EQ(Identities(state), std::multiset<int>{2});
}

TEST(Density, ASecondRunGivesTheSameBytesAndAnotherSeedDoesNot) {
  const auto run = [](uint64_t seed, int iteration) {
    SplatState state = Line(100, 0.5);
    DensityStats stats = Stats(std::vector<float>(100, 1e-3f));
    TrainOptions options;
    options.seed = seed;
    ControlDensity(options, kExtent, iteration, &state, &stats);
    return state.params.data();
  };
  const AlignedFloats first = run(1, 600);
  EXPECT_TRUE(SameBytes(first, run(1, 600)));
  EXPECT_FALSE(SameBytes(first, run(2, 600)));
  EXPECT_FALSE(SameBytes(first, run(1, 800)));
}

TEST(Density, StatsCountOnlyViewsWhereAGaussianIsSeen) {
  DensityStats stats;
  stats.Reset(3);
  ViewStats view;
  view.visible = {1, 0, 1};
  view.grad_means2d = {0.5f, 99, 0.25f};
  stats.Add(view, 40);
  view.visible = {0, 0, 1};
  stats.Add(view, 40);
  EXPECT_EQ(stats.views, (std::vector<float>{1, 0, 2}));
  EXPECT_EQ(stats.grad, (std::vector<float>{10, 0, 10}));
}

TEST(MortonOrder, IsAPermutationThatKeepsNeighboursTogether) {
  const Splats cloud = ColoredCloud(1000, 4);
  const std::vector<uint32_t> order = MortonOrder(cloud);
  std::vector<uint32_t> sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (uint32_t i = 0; i < 1000; ++i) ASSERT_EQ(sorted[i], i);
  const auto path = [&](auto index) {
    double length = 0;
    for (uint32_t i = 1; i < 1000; ++i) {
      const uint32_t a = index(i - 1), b = index(i);
      length += std::hypot(cloud.at(a, kMean) - cloud.at(b, kMean),
                           cloud.at(a, kMean + 1) - cloud.at(b, kMean + 1),
                           cloud.at(a, kMean + 2) - cloud.at(b, kMean + 2));
    }
    return length;
  };
  // A random walk through a cube of side 2 has steps of 1.3; 1000 points along a curve, some 0.25.
  EXPECT_LT(path([&](uint32_t i) { return order[i]; }), 0.4 * path([](uint32_t i) { return i; }));
}

TEST(MortonOrder, TiesAndOddMeansKeepTheirOrder) {
  Splats splats(20);
  EXPECT_EQ(MortonOrder(splats)[7], 7u);
  splats.at(3, kMean) = std::numeric_limits<float>::quiet_NaN();
  splats.at(4, kMean) = std::numeric_limits<float>::infinity();
  splats.at(5, kMean) = -std::numeric_limits<float>::infinity();
  std::vector<uint32_t> order = MortonOrder(splats);
  std::sort(order.begin(), order.end());
  for (uint32_t i = 0; i < 20; ++i) EXPECT_EQ(order[i], i);
  EXPECT_TRUE(MortonOrder(Splats()).empty());
}

}  // namespace
}  // namespace litags
