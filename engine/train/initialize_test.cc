#include "engine/train/initialize.h"

#include <array>
#include <cmath>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/train/train_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

std::vector<SparsePoint> RandomPoints(int n) {
  const CounterRng rng(8, 0);
  std::vector<SparsePoint> points(n);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) points[i].xyz[k] = rng.Uniform(3 * i + k) - 0.5;
    points[i].rgb = {255, 0, 51};
  }
  return points;
}

// A view whose photo is one grey and whose target has `gain` times its encoded value.
TrainView Flat(int index, float encoded, float gain) {
  TrainView view;
  view.view.camera = RingCamera(index, 4, 32, 24);
  view.photo = view.target = Photo(32, 24);
  std::fill(view.photo.data.begin(), view.photo.data.end(), PhotoSample(encoded));
  std::fill(view.target.data.begin(), view.target.data.end(), PhotoSample(gain * encoded));
  return view;
}

TEST(Initialize, ScaleIsTheRmsDistanceToThreeNeighbours) {
  const std::vector<SparsePoint> points = RandomPoints(300);
  const std::vector<TrainView> views = {Flat(0, 0.2f, 2)};
  const auto splats = InitializeFromPoints(points, {}, views, StartShape::kBall);
  ASSERT_TRUE(splats.ok()) << splats.status();
  ASSERT_EQ(splats->size(), 300u);
  for (size_t i = 0; i < points.size(); ++i) {
    std::vector<double> squared;
    for (size_t j = 0; j < points.size(); ++j) {
      if (i == j) continue;
      double sum = 0;
      for (int k = 0; k < 3; ++k) sum += std::pow(points[i].xyz[k] - points[j].xyz[k], 2);
      squared.push_back(sum);
    }
    std::nth_element(squared.begin(), squared.begin() + 2, squared.end());
    const double want = std::log(std::sqrt((squared[0] + squared[1] + squared[2]) / 3));
    for (int k = 0; k < 3; ++k) {
      ASSERT_NEAR(splats->at(i, kLogScale + k), want, 1e-4);  // float coordinates
      ASSERT_EQ(splats->at(i, kMean + k), float(points[i].xyz[k]));
    }
    ASSERT_NEAR(1 / (1 + std::exp(-splats->at(i, kLogitOpacity))), 0.1, 1e-6);
    ASSERT_EQ(splats->at(i, kRawQuat), 1);
  }
}

TEST(Initialize, ColourIsTheMeanTargetOfThePhotosThatSawThePoint) {
  std::vector<SparsePoint> points = RandomPoints(6);
  points[0].track = {{0, 0, 0}, {1, 0, 0}};  // model views 0 and 1
  points[1].track = {{2, 0, 0}};             // model view 2 is held out
  points[2].track = {{7, 0, 0}};             // no such view
  const std::vector<TrainView> views = {Flat(0, 0.25f, 1), Flat(1, 0.375f, 2)};
  const auto splats = InitializeFromPoints(points, {0, 1, -1}, views, StartShape::kBall);
  ASSERT_TRUE(splats.ok());
  const auto color = [&](size_t i, int c) { return 0.5 + kSh0 * splats->at(i, kShDc + c); };
  EXPECT_NEAR(color(0, 1), 0.5, 1e-6);
  for (const size_t i : {1, 2, 3}) {
    EXPECT_NEAR(color(i, 0), 1.0, 1e-6) << "no photo saw it: the point's own colour";
    EXPECT_NEAR(color(i, 1), 0.0, 1e-6);
    EXPECT_NEAR(color(i, 2), 0.2, 1e-6);
  }
}

TEST(Initialize, AttributesStartWhereTheLossesAreFlat) {
  const std::vector<SparsePoint> points = RandomPoints(5);
  const std::vector<TrainView> views = {Flat(0, 0.125f, 2), Flat(1, 0.125f, 4)};
  const auto splats = InitializeFromPoints(points, {}, views, StartShape::kBall);
  ASSERT_TRUE(splats.ok());
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(splats->at(i, kIllumination), (0.125 + 0.125) / (0.25 + 0.5), 1e-5);
    EXPECT_EQ(splats->at(i, kNoise), 0);
    EXPECT_EQ(splats->at(i, kStructure), 0);
    const double z0 = views[0].view.camera.CamFromWorld(points[i].xyz)[2];
    const double z1 = views[1].view.camera.CamFromWorld(points[i].xyz)[2];
    EXPECT_NEAR(splats->at(i, kDepth), (z0 + z1) / 2, 1e-5);
    for (int row = kShRest; row < kSplatRows; ++row) EXPECT_EQ(splats->at(i, row), 0);
  }
}

// The unit vector that Gaussian i is thin along: the third column of its rotation.
std::array<double, 3> ThinAxis(const Splats& s, size_t i) {
  const double w = s.at(i, kRawQuat), x = s.at(i, kRawQuat + 1), y = s.at(i, kRawQuat + 2),
               z = s.at(i, kRawQuat + 3);
  EXPECT_NEAR(w * w + x * x + y * y + z * z, 1, 1e-5);
  return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

TEST(Initialize, DisksLieInThePlaneOfTheirNeighbours) {
  const double normals[][3] = {{0, 0, 1}, {0, 0, -1}, {0.6, 0.8, 0}, {-0.48, 0.6, -0.64}};
  for (const auto& n : normals) {
    std::vector<SparsePoint> points = RandomPoints(200);
    for (SparsePoint& p : points) {  // down to a hundredth of their height above the plane
      double height = 0;
      for (int k = 0; k < 3; ++k) height += n[k] * p.xyz[k];
      for (int k = 0; k < 3; ++k) p.xyz[k] -= 0.99 * height * n[k];
    }
    const auto balls = InitializeFromPoints(points, {}, {}, StartShape::kBall);
    const auto disks = InitializeFromPoints(points, {}, {}, StartShape::kDisk);
    ASSERT_TRUE(balls.ok() && disks.ok());
    for (size_t i = 0; i < points.size(); ++i) {
      const std::array<double, 3> axis = ThinAxis(*disks, i);
      EXPECT_GT(std::abs(axis[0] * n[0] + axis[1] * n[1] + axis[2] * n[2]), 0.98);
      for (int k = 0; k < 3; ++k) {
        const double thinner = k == 2 ? std::log(0.1) : 0;
        EXPECT_NEAR(disks->at(i, kLogScale + k), balls->at(i, kLogScale + k) + thinner, 1e-5);
      }
    }
  }
}

TEST(Initialize, PointsThatFillSpaceStayBalls) {
  std::vector<SparsePoint> points;  // a grid: inside, the variances of neighbours are alike
  for (int i = 0; i < 343; ++i) {
    points.emplace_back().xyz = {double(i % 7), double(i / 7 % 7), double(i / 49)};
  }
  const auto disks = InitializeFromPoints(points, {}, {}, StartShape::kDisk);
  ASSERT_TRUE(disks.ok());
  const size_t middle = 3 + 7 * 3 + 49 * 3;
  EXPECT_EQ(disks->at(middle, kLogScale + 2), disks->at(middle, kLogScale));
  EXPECT_EQ(disks->at(middle, kRawQuat), 1);
}

TEST(Initialize, PointsInOnePlaceGiveFiniteGaussians) {
  const std::vector<SparsePoint> points(50, RandomPoints(1)[0]);
  for (const StartShape shape : {StartShape::kBall, StartShape::kDisk}) {
    const auto splats = InitializeFromPoints(points, {}, {}, shape);
    ASSERT_TRUE(splats.ok());
    ASSERT_EQ(splats->size(), points.size());
    for (const float v : splats->data()) ASSERT_TRUE(std::isfinite(v));
  }
}

TEST(Initialize, RefusesFewerThanFourPoints) {
  const auto splats = InitializeFromPoints(RandomPoints(3), {}, {}, StartShape::kBall);
  EXPECT_EQ(splats.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(splats.status()), "TOO_FEW_POINTS");
  EXPECT_TRUE(InitializeFromPoints(RandomPoints(4), {}, {}, StartShape::kBall).ok());
  EXPECT_TRUE(InitializeFromPoints(RandomPoints(4), {}, {}, StartShape::kDisk).ok())
      << "fewer than make a plane elsewhere";
}

TEST(SceneExtent, IsTheCamerasRadiusAndATenth) {
  std::vector<TrainView> views;
  for (int i = 0; i < 4; ++i) views.push_back(Flat(i, 1, 1));
  EXPECT_NEAR(SceneExtent(views), 1.1 * 4, 1e-9);
  EXPECT_GT(SceneExtent({}), 0);
  EXPECT_GT(SceneExtent(std::vector<TrainView>(3, views[0])), 0);
}

}  // namespace
}  // namespace litags
