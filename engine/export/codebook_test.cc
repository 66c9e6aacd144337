#include "engine/export/codebook.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/rng.h"

namespace litags {
namespace {

TEST(Codebook, FewValuesAreExactAndManyAreNear) {
  const Codebook few({3, 1, 2, 2, 1});
  for (float v : {1.0f, 2.0f, 3.0f}) EXPECT_NEAR(few.values()[few.Nearest(v)], v, 1e-6);

  const CounterRng rng(1, 1);
  std::vector<float> values;
  for (int i = 0; i < 20000; ++i) values.push_back(static_cast<float>(rng.Normal(2 * i)));
  const Codebook codebook(values);
  double squares = 0, worst = 0;
  for (float v : values) {
    const double error = codebook.values()[codebook.Nearest(v)] - v;
    squares += error * error;
    worst = std::max(worst, std::abs(error));
  }
  // 256 even steps from -4 to 4 have 0.009.
  EXPECT_LT(std::sqrt(squares / values.size()), 0.009);
  EXPECT_LT(worst, 0.2);
}

TEST(Codebook, NearestIsNearest) {
  const CounterRng rng(2, 1);
  std::vector<float> values;
  for (int i = 0; i < 3000; ++i) values.push_back(static_cast<float>(rng.Normal(2 * i)));
  const Codebook codebook(values);
  for (float v : values) {
    const float error = std::abs(codebook.values()[codebook.Nearest(v)] - v);
    for (float other : codebook.values()) ASSERT_LE(error, std::abs(other - v) + 1e-6);
  }
}

TEST(Palette, LikePointsShareAGroup) {
  const CounterRng rng(3, 1);
  std::vector<float> points;  // 40 clusters in 4 dimensions
  for (int i = 0; i < 1000; ++i) {
    for (int k = 0; k < 4; ++k) {
      points.push_back(static_cast<float>(10 * rng.Uniform(i % 40 * 4 + k) +
                                          0.001 * rng.Uniform(1000 + 4 * i + k)));
    }
  }
  const Palette palette = MakePalette(points, 4, 40);
  EXPECT_EQ(palette.count, 40u);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(palette.labels[i], palette.labels[i % 40]);
    for (int k = 0; k < 4; ++k) {
      EXPECT_NEAR(palette.centers[4 * palette.labels[i] + k], points[4 * i + k], 0.001);
    }
  }
}

TEST(Palette, EqualPointsAreOneGroup) {
  EXPECT_EQ(MakePalette(std::vector<float>(300, 0.1f), 3, 50).count, 1u);
  EXPECT_EQ(MakePalette({}, 3, 50).count, 0u);
  CancelToken raised;
  raised.Cancel();
  EXPECT_EQ(MakePalette({1, 2, 3}, 1, 3).count, 3u);
  EXPECT_EQ(MakePalette({1, 2, 3}, 1, 3, raised).count, 1u);
}

}  // namespace
}  // namespace litags
