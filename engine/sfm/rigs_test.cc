#include "engine/sfm/rigs.h"

#include <gtest/gtest.h>

#include <cmath>

namespace litags {
namespace {

constexpr double kFocal = 50;
constexpr std::array<double, 9> kRight = {0, 0, 1, 0, 1, 0, -1, 0, 0},
                                kAhead = {1, 0, 0, 0, 1, 0, 0, 0, 1};

PhotoFile PhotoOf(const char* name) {
  PhotoFile photo;
  photo.name = name;
  photo.width = photo.height = 100;
  return photo;
}

TEST(Rigs, AViewIsPlacedBesideThoseOfItsRig) {
  RigViews rigs;
  rigs["a_ahead"] = {"a", kAhead, kFocal};
  rigs["a_right"] = {"a", kRight, kFocal};
  rigs["b_ahead"] = {"b", kAhead, kFocal};
  rigs["b_right"] = {"b", kRight, kFocal};
  const std::vector<PhotoFile> photos = {PhotoOf("a_ahead"), PhotoOf("a_right"), PhotoOf("b_ahead"),
                                         PhotoOf("b_right"), PhotoOf("other")};
  SparseModel model;
  View& right = model.views.emplace_back();
  right.name = "a_right";
  right.camera = {.width = 100, .height = 100, .fx = 50.1, .fy = 50.1, .cx = 50, .cy = 50};
  right.camera.R = {std::cos(0.3), 0, std::sin(0.3), 0, 1, 0, -std::sin(0.3), 0, std::cos(0.3)};
  right.camera.t = {1, 2, 3};
  model.distortions.resize(1);
  SparsePoint& point = model.points.emplace_back();
  point.track.push_back({0, 5, 5});
  const Camera known = right.camera;
  PlaceRigViews(rigs, photos, &model);

  ASSERT_EQ(model.views.size(), 2u);  // rig b has no view in the model
  EXPECT_EQ(model.views[0].name, "a_ahead");
  EXPECT_EQ(model.distortions.size(), 2u);
  EXPECT_EQ(model.points[0].track[0].view, 1);
  const Camera& ahead = model.views[0].camera;
  EXPECT_EQ(ahead.fx, kFocal);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(ahead.Center()[k], known.Center()[k], 1e-12);
  // What lies straight ahead of the placed camera lies to the right of this one.
  const auto seen = ahead.CamFromWorld(known.WorldFromCam({0, 0, 4}));
  EXPECT_NEAR(seen[0], 4, 1e-12);
  EXPECT_NEAR(seen[2], 0, 1e-12);
}

}  // namespace
}  // namespace litags
