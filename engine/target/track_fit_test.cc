#include "engine/target/track_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "engine/core/rng.h"

namespace litags {
namespace {

struct Explicit {
  Eigen::VectorXd solution;  // offsets, coefficients, the points' own numbers
  Eigen::MatrixXd inverse;
};

// The weighted least squares of FitTracks with every unknown written out.
Explicit SolveExplicitly(int photos, int points, const std::vector<TrackValue>& values,
                         const std::vector<double>& weights) {
  const int first = photos + kTrackColumns;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(first + points, first + points);
  Eigen::VectorXd moment = Eigen::VectorXd::Zero(first + points);
  for (size_t s = 0; s < values.size(); ++s) {
    Eigen::VectorXd row = Eigen::VectorXd::Zero(first + points);
    row(values[s].photo) = 1;
    for (int k = 0; k < kTrackColumns; ++k) row(photos + k) = values[s].columns[k];
    row(first + values[s].point) = 1;
    matrix += weights[s] * row * row.transpose();
    moment += weights[s] * values[s].value * row;
  }
  for (int i = 0; i < photos; ++i) matrix(i, i) += 1;  // the prior
  const Eigen::MatrixXd inverse = matrix.fullPivLu().inverse();
  return {inverse * moment, inverse};
}

struct World {
  int photos = 7, points = 60;
  std::vector<TrackValue> values;
};

// Each point is seen by some photos; a twelfth of the values are wrong.
World MakeWorld(bool columns) {
  const CounterRng number(3, 1), noise(3, 2), seen(3, 3), place(3, 4);
  World w;
  for (int point = 0; point < w.points; ++point) {
    for (int photo = 0; photo < w.photos; ++photo) {
      const uint64_t id = static_cast<uint64_t>(point) * w.photos + photo;
      if (seen.Uniform(id) < 0.5) continue;
      TrackValue v{point, photo, number.Uniform(point) + 0.1 * photo, {}};
      v.value += 0.05 * (noise.Uniform(id) - 0.5);
      if (id % 12 == 0) v.value += 3;
      if (columns) {
        const double r = place.Uniform(id);
        v.columns = {r, r * r, r * r * r};
        v.value -= 0.3 * r;
      }
      w.values.push_back(v);
    }
  }
  return w;
}

TEST(TrackFit, IsTheWeightedLeastSquaresOfAllUnknowns) {
  const World w = MakeWorld(/*columns=*/true);
  const TrackFit fit = FitTracks(w.photos, w.values);
  const Explicit whole = SolveExplicitly(w.photos, w.points, w.values, fit.weights);
  for (int i = 0; i < w.photos; ++i) {
    EXPECT_NEAR(fit.offsets[i], whole.solution(i), 1e-9) << i;
  }
}

TEST(TrackFit, ErrorsAreThoseOfTheWholeInverse) {
  const World w = MakeWorld(/*columns=*/true);
  const TrackFit fit = FitTracks(w.photos, w.values);
  const Explicit whole = SolveExplicitly(w.photos, w.points, w.values, fit.weights);
  const Eigen::MatrixXd from_mean =
      Eigen::MatrixXd::Identity(w.photos, w.photos).array() - 1.0 / static_cast<double>(w.photos);
  const Eigen::MatrixXd covariance =
      from_mean * whole.inverse.topLeftCorner(w.photos, w.photos) * from_mean;
  for (int i = 0; i < w.photos; ++i) {
    EXPECT_NEAR(fit.errors[i], fit.noise * std::sqrt(covariance(i, i)), 1e-9) << i;
  }
}

TEST(TrackFit, WithoutColumnsFindsOffsetsDespiteWrongValues) {
  const World w = MakeWorld(/*columns=*/false);
  const TrackFit fit = FitTracks(w.photos, w.values);
  for (int i = 1; i < w.photos; ++i) {
    EXPECT_NEAR(fit.offsets[i] - fit.offsets[0], 0.1 * i, 0.05) << i;
  }
  ASSERT_EQ(fit.errors.size(), size_t(w.photos));
  for (const double error : fit.errors) EXPECT_GT(error, 0);
}

TEST(TrackFit, EndsSoonOnceItIsCancelled) {
  const World w = MakeWorld(/*columns=*/false);
  CancelToken cancel;
  cancel.Cancel();
  // No round has weighed wrong values; a point's only value counts for nothing from the start.
  const TrackFit fit = FitTracks(w.photos, w.values, cancel);
  ASSERT_EQ(fit.weights.size(), w.values.size());
  for (const double weight : fit.weights) {
    EXPECT_TRUE(weight == 0 || weight == 1) << weight;
  }
}

TEST(TrackFit, OfNoPhotosIsEmpty) {
  const TrackFit fit = FitTracks(0, {});
  EXPECT_TRUE(fit.offsets.empty());
  EXPECT_TRUE(fit.errors.empty());
}

}  // namespace
}  // namespace litags
