#include "engine/export/viewer_scene.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "engine/export/export_test_util.h"

namespace litags {
namespace {

// About an axis that is none of the coordinates'.
Matrix3 SomeRotation() { return RotationTo({0.36, -0.48, 0.8}, UpAxis::kX); }

Matrix3 Product(const Matrix3& a, const Matrix3& b) {
  Matrix3 out{};
  for (int i = 0; i < 9; ++i) {
    for (int k = 0; k < 3; ++k) out[i] += a[i / 3 * 3 + k] * b[3 * k + i % 3];
  }
  return out;
}

TEST(RotateSh, PicturesFromTurnedCamerasAreEqualForEveryDegree) {
  const Matrix3 rotation = Product(SomeRotation(), RotationTo({0, 0.6, 0.8}, UpAxis::kNegativeY));
  Matrix3 inverse;
  for (int i = 0; i < 9; ++i) inverse[i] = rotation[i % 3 * 3 + i / 3];
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    const ViewerScene scene = SmallScene(200, degree);
    Splats turned = scene.splats;
    Rotate(rotation, &turned);
    for (const View& view : scene.views) {
      Camera camera = view.camera;
      camera.R = Product(view.camera.R, inverse);
      const Planes before = Picture(scene.splats, view.camera);
      EXPECT_LT(Difference(before, Picture(turned, camera)), 1e-4) << degree;
      // It is the colours, too, that turn: without them the pictures differ.
      if (degree == 0) continue;
      Splats wrong = turned;
      for (size_t i = 0; i < wrong.size(); ++i) {
        for (int row = kShRest; row < kSplatRows; ++row) {
          wrong.at(i, row) = scene.splats.at(i, row);
        }
      }
      EXPECT_GT(Difference(before, Picture(wrong, camera)), 5e-3) << degree;
    }
  }
}

TEST(RotateSh, ThereAndBackIsWhereItWas) {
  const ViewerScene scene = SmallScene(50);
  Splats splats = scene.splats;
  const Matrix3 rotation = SomeRotation();
  Rotate(rotation, &splats);
  Matrix3 inverse;
  for (int i = 0; i < 9; ++i) inverse[i] = rotation[i % 3 * 3 + i / 3];
  Rotate(inverse, &splats);
  const Errors errors = ErrorsOf(scene.splats, splats);
  EXPECT_LT(errors.position, 1e-6);
  EXPECT_LT(errors.angle, 1e-5);
  EXPECT_LT(errors.harmonics, 1e-6);
}

TEST(PlaceScene, UpBecomesTheAxisAndTheCamerasGoWithIt) {
  const std::array<double, 3> up = {0.48, -0.8, 0.36};
  for (const UpAxis axis : {UpAxis::kX, UpAxis::kNegativeX, UpAxis::kY, UpAxis::kNegativeY,
                            UpAxis::kZ, UpAxis::kNegativeZ}) {
    const ViewerScene scene = SmallScene(100);
    ViewerScene placed = scene;
    placed.splats.at(0, kMean) = 0.48f;
    placed.splats.at(0, kMean + 1) = -0.8f;
    placed.splats.at(0, kMean + 2) = 0.36f;
    ViewerScene before = placed;
    PlaceScene(up, axis, /*scale=*/2.5, &placed);
    const std::array<double, 3> want = DirectionOf(axis);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(placed.splats.at(0, kMean + k), 2.5 * want[k], 1e-6);
    for (size_t v = 0; v < scene.views.size(); ++v) {
      EXPECT_TRUE(placed.views[v].camera.Validate("view").ok());
      EXPECT_LT(Difference(Picture(before.splats, before.views[v].camera),
                           Picture(placed.splats, placed.views[v].camera)),
                1e-4);
    }
  }
}

TEST(PlaceScene, WhatTheCamerasLookAtGoesWithThem) {
  ViewerScene scene = SmallScene(5);
  scene.center = {0, 2, 0};
  scene.radius = 3;
  PlaceScene({0, -1, 0}, UpAxis::kZ, /*scale=*/10, &scene);
  EXPECT_NEAR(scene.center[2], -20, 1e-9);
  EXPECT_NEAR(scene.up_direction[2], 1, 1e-9);
  EXPECT_NEAR(scene.radius, 30, 1e-9);
}

// What files name for it must go with the positions.
TEST(PlaceScene, TheMapsPointGoesWithTheScene) {
  ViewerScene scene = SmallScene(5);
  scene.origin = {500000, 3999999, 301};
  PlaceScene({0, 0, 1}, UpAxis::kY, /*scale=*/10, &scene);
  EXPECT_NEAR(scene.origin[0], 5'000'000, 1e-6);
  EXPECT_NEAR(scene.origin[1], 3010, 1e-6);
  EXPECT_NEAR(scene.origin[2], -39'999'990, 1e-6);
}

TEST(PlaceScene, KeptAndUnscaledItIsAsItWas) {
  ViewerScene scene = SmallScene(20);
  scene.origin = {500000, 3999999, 301};
  ViewerScene placed = scene;
  PlaceScene({0, -1, 0}, UpAxis::kKeep, 1, &placed);
  EXPECT_TRUE(SameBytes(placed.splats.data(), scene.splats.data()));
  EXPECT_EQ(placed.views[3].camera.t, scene.views[3].camera.t);
  EXPECT_EQ(placed.origin, scene.origin);
}

TEST(Crop, KeepsCentresInsideInTheirOrder) {
  ViewerScene scene = SmallScene(100);
  scene.origin = {1000, 0, -1000};
  const Splats all = scene.splats;
  Crop({{1000, -0.5, -1001}, {1000.5, 0.5, -999}}, &scene);
  size_t to = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    const float x = all.at(i, kMean), y = all.at(i, kMean + 1);
    if (x < 0 || x > 0.5f || std::abs(y) > 0.5f) continue;
    ASSERT_LT(to, scene.splats.size());
    EXPECT_EQ(scene.splats.at(to++, kMean), x);
  }
  EXPECT_EQ(to, scene.splats.size());
  EXPECT_GT(to, 5u);
}

TEST(KeepHeaviest, WhatNoPictureNeedsGoesFirst) {
  ViewerScene scene = SmallScene(300);
  std::set<size_t> useless;
  for (size_t i = 0; i < 100; ++i) {
    useless.insert(3 * i);
    if (i % 2 == 0) {  // out of all pictures
      scene.splats.at(3 * i, kMean + 1) = 60;
    } else {  // all but transparent
      scene.splats.at(3 * i, kLogitOpacity) = -8;
    }
  }
  const Splats all = scene.splats;
  ASSERT_TRUE(KeepHeaviest(200, 0, CancelToken(), &scene).ok());
  ASSERT_EQ(scene.splats.size(), 200u);
  size_t at = 0;
  for (size_t i = 0; i < all.size() && at < 200; ++i) {
    if (all.at(i, kMean) != scene.splats.at(at, kMean)) continue;
    EXPECT_EQ(useless.count(i), 0u) << i;
    ++at;
  }
  EXPECT_EQ(at, 200u);
}

// Six views from each of 64 places on a line: ahead, behind, right, left, down, up.
std::vector<View> Panoramas() {
  std::vector<View> views;
  for (int i = 0; i < 6 * 64; ++i) {
    const int axis = 2 - i % 6 / 2;
    const std::array<double, 3> center = {0.002 * (i / 6), 0, 0};
    std::array<double, 3> target = center;
    target[axis] += i % 2 == 0 ? 1 : -1;
    View view{"photo" + std::to_string(i), RingCamera(0, 6, 40, 40)};
    const std::array<double, 3> up = {0, axis == 1 ? 0.0 : -1.0, axis == 1 ? 1.0 : 0.0};
    EXPECT_TRUE(view.camera.LookAt(center, target, up).ok());
    views.push_back(std::move(view));
  }
  return views;
}

TEST(KeepHeaviest, WhatOneDirectionOfPanoramasSeesIsNeeded) {
  ViewerScene scene;
  scene.views = Panoramas();
  scene.splats = Splats(12);
  for (size_t i = 0; i < 12; ++i) {
    scene.splats.at(i, kMean + (2 - i / 4)) = i / 2 % 2 == 0 ? 3 : -3;
    for (int k = 0; k < 3; ++k) scene.splats.at(i, kLogScale + k) = std::log(0.2f);
    scene.splats.at(i, kRawQuat) = 1;
    scene.splats.at(i, kLogitOpacity) = i % 2 == 0 ? -8 : 2;  // all but transparent, or not
  }
  ASSERT_TRUE(KeepHeaviest(6, 0, CancelToken(), &scene).ok());
  ASSERT_EQ(scene.splats.size(), 6u);
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(scene.splats.at(i, kLogitOpacity), 2) << i;
}

TEST(KeepHeaviest, AllStayIfThereAreFewEnoughAndCancellingEndsIt) {
  ViewerScene scene = SmallScene(30);
  ASSERT_TRUE(KeepHeaviest(30, 0, CancelToken(), &scene).ok());
  EXPECT_EQ(scene.splats.size(), 30u);
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_EQ(KeepHeaviest(10, 0, cancel, &scene).code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
