// Lenses beyond k1 k2 p1 p2.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "engine/core/photo.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/io/seen_point_test_util.h"
#include "engine/io/sparse_model.h"
#include "engine/io/transforms_io.h"

namespace litags {
namespace {

Camera TestCamera() {
  Camera camera;
  camera.width = 160;
  camera.height = 120;
  camera.fx = 100;
  camera.fy = 110;
  camera.cx = 78;
  camera.cy = 61;
  return camera;
}

const Distortion kFull{.k1 = -0.1,
                       .k2 = 0.03,
                       .p1 = 0.002,
                       .p2 = -0.001,
                       .k3 = 0.004,
                       .k4 = 0.02,
                       .k5 = -0.01,
                       .k6 = 0.003};
const Distortion kFisheye{.k1 = 0.02, .k2 = -0.01, .k3 = 0.004, .k4 = -0.001, .fisheye = true};

TEST(Lens, SeesWhereOpenCvsFormulasPut) {
  const double x = 0.4, y = -0.3, r2 = 0.25;
  const double radial = (1 - 0.1 * r2 + 0.03 * r2 * r2 + 0.004 * r2 * r2 * r2) /
                        (1 + 0.02 * r2 - 0.01 * r2 * r2 + 0.003 * r2 * r2 * r2);
  const auto full = Distort(kFull, x, y);
  EXPECT_NEAR(full[0], x * radial + 2 * 0.002 * x * y - 0.001 * (r2 + 2 * x * x), 1e-15);
  EXPECT_NEAR(full[1], y * radial + 0.002 * (r2 + 2 * y * y) - 2 * 0.001 * x * y, 1e-15);
  const double t = std::atan(0.5);
  const double at = t + 0.02 * std::pow(t, 3) - 0.01 * std::pow(t, 5) + 0.004 * std::pow(t, 7) -
                    0.001 * std::pow(t, 9);
  const auto fisheye = Distort(kFisheye, x, y);
  EXPECT_NEAR(fisheye[0], x / 0.5 * at, 1e-15);
  EXPECT_NEAR(fisheye[1], y / 0.5 * at, 1e-15);
  EXPECT_EQ(Distort(kFisheye, 0, 0), (std::array<double, 2>{0, 0}));
}

TEST(Lens, UndistortIsTheInverse) {
  for (const Distortion& lens : {kFull, kFisheye, Distortion{.fisheye = true}}) {
    for (const double x : {-0.7, 0.0, 0.2, 0.9}) {
      const auto seen = Distort(lens, x, 0.5 * x - 0.1);
      const auto back = Undistort(lens, seen[0], seen[1]);
      ASSERT_TRUE(back.has_value()) << x;
      EXPECT_NEAR((*back)[0], x, 1e-9);
      EXPECT_NEAR((*back)[1], 0.5 * x - 0.1, 1e-9);
    }
  }
  // Behind the camera.
  EXPECT_EQ(Undistort(Distortion{.fisheye = true}, 2, 0), std::nullopt);
}

// The curve of k1 = -0.3 rises up to r = 1.054, which it puts at 0.703.
TEST(Lens, BeyondWhereTheCurveRisesNoPointIsSeen) {
  const Distortion barrel{.k1 = -0.3};
  for (const double x : {0.3, 0.7, 0.9, 1.0}) {
    const auto back = Undistort(barrel, Distort(barrel, x, 0)[0], 0);
    ASSERT_TRUE(back.has_value()) << x;
    EXPECT_NEAR((*back)[0], x, 1e-5);
  }
  // Also where it rises again, and puts points there that lie far out.
  const Distortion twice{.k1 = -0.5, .k2 = 0.1};
  for (const Distortion& lens : {barrel, twice}) {
    for (const double seen : {0.71, 0.8, 1.2}) {
      EXPECT_EQ(Undistort(lens, seen, 0), std::nullopt) << seen;
      EXPECT_EQ(Undistort(lens, 0, -seen), std::nullopt) << seen;
    }
  }
  const Distortion fisheye{.k1 = -0.3, .fisheye = true};
  EXPECT_EQ(Undistort(fisheye, 0.71, 0), std::nullopt);
}

TEST(Lens, PhotosOfAFisheyeBecomeThoseOfAPinhole) {
  const Camera camera = TestCamera();
  const auto pattern = [](double u, double v) { return 0.5 + 0.3 * std::sin(6 * u + 4 * v); };
  Photo photo(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      // The ray that this pixel of the fisheye sees.
      const auto ray =
          Undistort(kFisheye, (x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
      std::fill_n(photo.pixel(x, y), 3,
                  PhotoSample(static_cast<float>(pattern(ray->at(0), ray->at(1)))));
    }
  }
  const auto pinhole = Undistort(photo, camera, kFisheye);
  ASSERT_TRUE(pinhole.ok()) << pinhole.status();
  for (int y = 4; y < camera.height - 4; y += 3) {
    for (int x = 4; x < camera.width - 4; x += 3) {
      const double u = (x + 0.5 - camera.cx) / camera.fx, v = (y + 0.5 - camera.cy) / camera.fy;
      EXPECT_NEAR(EncodedOf(pinhole->pixel(x, y)[0]), pattern(u, v), 0.004) << x << " " << y;
    }
  }
}

SparseModel OneView(const Distortion& lens) {
  SparseModel model;
  View view{"a.jpg", TestCamera()};
  view.camera.R = kRotation;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) view.camera.t[r] -= kRotation[3 * r + c] * kCenter[c];
  }
  model.views = {view};
  model.distortions = {lens};
  return model;
}

TEST(Lens, ComesBackFromColmapsModelAndTransformsJson) {
  for (const Distortion& lens : {kFull, kFisheye, Distortion{.k3 = 0.1}}) {
    const SparseModel model = OneView(lens);
    TempDir dir;
    ASSERT_TRUE(WriteColmapModel(dir.path(), model).ok());
    const auto colmap = ReadColmapModel(dir.path(), "cameras");
    ASSERT_TRUE(colmap.ok()) << colmap.status();
    const auto json = ParseTransforms(FormatTransforms(model, ""), "cameras");
    ASSERT_TRUE(json.ok()) << json.status();
    for (const SparseModel* read : {&*colmap, &*json}) {
      EXPECT_EQ(read->distortions[0].Coefficients(), lens.Coefficients());
      EXPECT_EQ(read->distortions[0].fisheye, lens.fisheye);
      EXPECT_NEAR(Seen(*read)[0], Seen(model)[0], 1e-9);
    }
  }
}

// Its curve rises up to 51.7 degrees, and puts nothing farther out.
TEST(Lens, PointsNearTheRimOfAFisheyeComeBack) {
  const Distortion lens{.k1 = -0.03, .k2 = 0.17, .k3 = -0.5, .k4 = 0.1, .fisheye = true};
  const double degree = std::atan(1) / 45;
  for (int degrees = 1; degrees <= 51; ++degrees) {
    const double x = std::tan(degrees * degree);
    const auto seen = Distort(lens, x, 0);
    EXPECT_NEAR(std::atan(Undistort(lens, seen[0], seen[1]).value()[0]) / degree, degrees, 1e-6);
  }
  EXPECT_NEAR(FisheyeAngle(lens, 9, 2) / degree, 51.7, 0.1);
}

TEST(Lens, ColmapsRadialFisheyesAreRead) {
  const auto read = [](const std::string& camera) {
    const auto model =
        ParseColmapText("1 " + camera + "\n", "1 1 0 0 0 0 0 0 1 a.jpg\n\n", "", "cameras");
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->distortions[0] : Distortion();
  };
  const Distortion one = read("SIMPLE_RADIAL_FISHEYE 160 120 100 80 60 0.01");
  EXPECT_TRUE(one.fisheye && one.k1 == 0.01 && one.k2 == 0);
  const Distortion two = read("RADIAL_FISHEYE 160 120 100 80 60 0.01 0.02");
  EXPECT_TRUE(two.fisheye && two.k1 == 0.01 && two.k2 == 0.02);
  const Distortion four = read("OPENCV_FISHEYE 160 120 100 101 80 60 0.01 0.02 0.03 0.04");
  EXPECT_TRUE(four.fisheye && four.k2 == 0.02 && four.k3 == 0.03 && four.k4 == 0.04);
  const Distortion full = read("FULL_OPENCV 160 120 100 101 80 60 1 2 3 4 5 6 7 8");
  EXPECT_EQ(full.Coefficients(), (std::array<double, 8>{1, 2, 3, 4, 5, 6, 7, 8}));
}

}  // namespace
}  // namespace litags
