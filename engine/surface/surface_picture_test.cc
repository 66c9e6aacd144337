#include "engine/surface/surface_picture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/surface/surface_test_util.h"

namespace litags {
namespace {

TEST(SurfacePicture, FacingTurnsDepthIntoDistance) {
  const SurfacePicture picture = PictureFrom({1.5, 0, -3});
  const Planes facing = FacingOf(picture);
  int compared = 0;
  for (int y = 1; y + 1 < picture.camera.height; ++y) {
    for (int x = 1; x + 1 < picture.camera.width; ++x) {
      const auto on_wall = [&](int dx, int dy) {
        return std::abs(picture.PointAt(x + dx, y + dy)[2] - kWallDepth) < 1e-5;
      };
      if (!on_wall(1, 0) || !on_wall(-1, 0) || !on_wall(0, 1) || !on_wall(0, -1)) continue;
      SurfacePicture nearer = picture;
      nearer.depth.at(0, y, x) -= 0.1f;
      const double distance = kWallDepth - nearer.PointAt(x, y)[2];
      EXPECT_NEAR(0.1 * facing.at(0, y, x), distance, 1e-4);
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000);
}

TEST(SurfacePicture, DepthIsTakenBetweenKnownPixels) {
  SurfacePicture picture = PictureFrom({0, 0, -3});
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 120; ++x) picture.depth.at(0, y, x) = static_cast<float>(1 + x);
  }
  EXPECT_FLOAT_EQ(DepthAt(picture, 20.5, 30.5), 21);
  EXPECT_FLOAT_EQ(DepthAt(picture, 20.75, 30.1), 21.25);
  picture.depth.at(0, 30, 21) = 0;
  EXPECT_FLOAT_EQ(DepthAt(picture, 20.75, 30.5), 21);  // without the one that is not known
  EXPECT_EQ(DepthAt(picture, 21.5, 30.5), 0);
  EXPECT_EQ(DepthAt(picture, 120.5, 30.5), 0);
  EXPECT_EQ(DepthAt(picture, -0.5, 30.5), 0);
}

TEST(SurfacePicture, AgreementIsTheDifferenceOfDepths) {
  const std::array<double, 3> eye = {0, 0, -3};
  EXPECT_LT(DepthAgreement({PictureFrom(eye), PictureFrom(eye)}), 1e-6);
  const double differ = DepthAgreement({PictureFrom(eye), PictureFrom(eye, 0.05)});
  EXPECT_GT(differ, 0.05 / 5.1);
  EXPECT_LT(differ, 0.05 / 2);
  EXPECT_EQ(DepthAgreement({PictureFrom(eye), PictureFrom(eye, 1)}), 0);  // other surfaces
  EXPECT_EQ(DepthAgreement({PictureFrom(eye)}), 0);
}

TEST(SurfacePicture, MediansAreOfTheBox) {
  const SurfacePicture picture = PictureFrom({0, 0, -3});
  const MedianPixel wall = MedianPixelOf({picture}, Box{{-9, -9, 1.9}, {9, 9, 2.1}});
  EXPECT_NEAR(wall.depth, 5, 1e-5);
  EXPECT_NEAR(wall.width, 5.0 / 120, 1e-6);
  EXPECT_EQ(MedianPixelOf({picture}, Box{{8, 8, 8}, {9, 9, 9}}).depth, 0);
}

}  // namespace
}  // namespace litags
