#include "engine/eval/flicker.h"

#include <array>
#include <cmath>
#include <functional>

#include "engine/core/camera_path.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using Point = std::array<double, 3>;

Camera CameraAt(const Point& eye, const Point& target) {
  Camera camera;
  camera.width = 80;
  camera.height = 60;
  camera.fx = camera.fy = 90;
  camera.cx = 40;
  camera.cy = 30;
  EXPECT_TRUE(camera.LookAt(eye, target, {0, -1, 0}).ok());
  return camera;
}

// A colour of a place in the world.
using Paint = std::function<Point(const Point&)>;

// The plane z = z0 + slope x, and in front of it, if `box`, a square on z = 2 with |x|, |y| < 0.5.
struct World {
  double z0 = 4, slope = 0;
  bool box = false;
  Paint plane = [](const Point&) { return Point{0.2, 0.5, 0.8}; };
};

PathFrame Photograph(const World& world, const Camera& camera) {
  PathFrame frame{camera, Planes(3, camera.height, camera.width),
                  Planes(1, camera.height, camera.width)};
  const Point eye = camera.Center();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const double u = (x + 0.5 - camera.cx) / camera.fx, v = (y + 0.5 - camera.cy) / camera.fy;
      Point ray;  // of length 1 along the axis
      for (int i = 0; i < 3; ++i) ray[i] = camera.R[i] * u + camera.R[3 + i] * v + camera.R[6 + i];
      double t = (world.z0 + world.slope * eye[0] - eye[2]) / (ray[2] - world.slope * ray[0]);
      Point color = world.plane({eye[0] + t * ray[0], eye[1] + t * ray[1], eye[2] + t * ray[2]});
      const double near = (2 - eye[2]) / ray[2];
      if (world.box && std::abs(eye[0] + near * ray[0]) < 0.5 &&
          std::abs(eye[1] + near * ray[1]) < 0.5) {
        t = near;
        color = {0.9, 0.1, 0.1};
      }
      frame.depth.at(0, y, x) = static_cast<float>(t);
      for (int c = 0; c < 3; ++c) frame.color.at(c, y, x) = static_cast<float>(color[c]);
    }
  }
  return frame;
}

Flicker Measure(const PathFrame& from, const PathFrame& to) {
  const auto flicker = MeasureFlicker(from, to);
  EXPECT_TRUE(flicker.ok()) << flicker.status();
  return flicker.value_or(Flicker());
}

const Camera kLeft = CameraAt({-0.2, 0.1, 0}, {0, 0, 4}),
             kRight = CameraAt({0.1, 0, 0.2}, {0, 0, 4});

TEST(Flicker, AStillWorldOfPlainColoursHasNone) {
  for (const double slope : {0.0, 0.5}) {
    const World world{.slope = slope};
    const Flicker flicker = Measure(Photograph(world, kLeft), Photograph(world, kRight));
    EXPECT_LT(flicker.Mean(), 1e-7);  // rounding of floats
    EXPECT_GT(flicker.Share(), 0.8);
    EXPECT_EQ(flicker.pixels, 80 * 60);
  }
}

TEST(Flicker, WhatIsAddedByHandIsMeasured) {
  const World world;
  const PathFrame from = Photograph(world, kLeft);
  PathFrame to = Photograph(world, kRight);
  for (float& v : to.color.data) v += 0.04f;
  EXPECT_NEAR(Measure(from, to).Mean(), 0.04, 1e-6);
  // One channel of three, the other way.
  to = Photograph(world, kRight);
  for (size_t i = 0; i < to.color.plane_size(); ++i) to.color.plane(1)[i] -= 0.06f;
  EXPECT_NEAR(Measure(from, to).Mean(), 0.02, 1e-6);
}

TEST(Flicker, ATextureMovesWithItsSurface) {
  const World world{.slope = 0.4, .plane = [](const Point& p) {
                      return Point{0.5 + 0.4 * std::sin(5 * p[0]), 0.5 + 0.4 * std::sin(4 * p[1]),
                                   0.5 + 0.3 * std::sin(3 * (p[0] + p[1]))};
                    }};
  const PathFrame from = Photograph(world, kLeft), to = Photograph(world, kRight);
  double unmoved = 0;
  for (size_t i = 0; i < from.color.data.size(); ++i) {
    unmoved += std::abs(from.color.data[i] - to.color.data[i]) / from.color.data.size();
  }
  EXPECT_GT(unmoved, 0.05) << "the motion would show";
  // The finest wave is 28 px long: interpolation is off by about 0.4 (2 pi / 28)^3 / 24.
  EXPECT_LT(Measure(from, to).Mean(), 2e-4);
}

TEST(Flicker, WhatIsHiddenInOneFrameDoesNotCount) {
  const World world{.box = true};
  const PathFrame from = Photograph(world, kLeft), to = Photograph(world, kRight);
  const Flicker flicker = Measure(from, to);
  // The box differs from the wall by 0.6; a single pixel taken for the other would give 4e-5.
  EXPECT_LT(flicker.Mean(), 1e-6);
  EXPECT_LT(flicker.Share(),
            Measure(Photograph(World(), kLeft), Photograph(World(), kRight)).Share())
      << "outlines and what they hide";
  EXPECT_GT(flicker.Share(), 0.5);
}

TEST(Flicker, NothingInCommonIsNothingCompared) {
  const World world;
  const PathFrame from = Photograph(world, CameraAt({-30, 0, 0}, {-30, 0, 4}));
  PathFrame to = Photograph(world, kRight);
  EXPECT_EQ(Measure(from, to).compared, 0);
  to.depth.data.assign(to.depth.data.size(), 0.0f);
  EXPECT_EQ(Measure(to, to).compared, 0);
  EXPECT_EQ(Measure(to, to).Mean(), 0);
}

TEST(Flicker, StepsAddUp) {
  Flicker sum{.difference = 1, .compared = 10, .pixels = 20};
  sum.Add({.difference = 2, .compared = 20, .pixels = 20});
  EXPECT_DOUBLE_EQ(sum.Mean(), 0.1);
  EXPECT_DOUBLE_EQ(sum.Share(), 0.75);
}

TEST(Flicker, FramesThatDoNotFitTheirCamerasAreRefused) {
  const PathFrame good = Photograph(World(), kLeft);
  PathFrame bad = good;
  bad.depth = Planes(1, 60, 79);
  EXPECT_EQ(MeasureFlicker(good, bad).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(MeasureFlicker(bad, good).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(CameraPath, GoesThroughItsKeysAndEndsAtTheLast) {
  const std::vector<Camera> keys = {kLeft, CameraAt({0, -0.3, 0.1}, {0, 0, 4}), kRight};
  const std::vector<Camera> path = PathThrough(keys, 9, /*closed=*/false, kLeft);
  ASSERT_EQ(path.size(), 9u);
  for (const int k : {0, 1, 2}) {
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(path[4 * k].R[i], keys[k].R[i], 1e-12);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(path[4 * k].t[i], keys[k].t[i], 1e-12);
  }
  for (const Camera& camera : path) EXPECT_TRUE(camera.Validate("camera").ok());
  // A closed path of as many frames as keys shows each once, and not the first again.
  const std::vector<Camera> round = PathThrough(keys, 3, /*closed=*/true, kLeft);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(round[2].t[i], kRight.t[i], 1e-12);
}

}  // namespace
}  // namespace litags
