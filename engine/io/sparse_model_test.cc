#include "engine/io/sparse_model.h"

#include <cmath>
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/core/photo.h"
#include "engine/io/cameras_io.h"
#include "engine/io/test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

Camera TestCamera() {
  Camera camera;
  camera.width = 120;
  camera.height = 80;
  camera.fx = 100;
  camera.fy = 90;
  camera.cx = 62;
  camera.cy = 39;
  return camera;
}

// Smooth in x and y, so that resampling adds no more than rounding.
double Pattern(double x, double y, int c) { return 127 + 100 * std::sin(0.05 * x + 0.03 * y + c); }

TEST(LargestShift, IsThatOfTheFarthestCorner) {
  const Camera camera = TestCamera();
  EXPECT_EQ(LargestShift(camera, Distortion()), 0);
  const double x = -62.0 / 100, y = 41.0 / 90, r2 = x * x + y * y;  // bottom left
  EXPECT_NEAR(LargestShift(camera, {.k1 = 0.1}), 0.1 * r2 * std::hypot(100 * x, 90 * y), 1e-9);
  EXPECT_NEAR(LargestShift(camera, {.p1 = 0.01}),
              0.01 * std::hypot(100 * 2 * x * y, 90 * (r2 + 2 * y * y)), 1e-9);
}

TEST(Undistort, FollowsTheBrownConradyModel) {
  const Camera camera = TestCamera();
  const Distortion d{.k1 = -0.2, .k2 = 0.05, .p1 = 0.01, .p2 = -0.004};
  Photo photo(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        photo.pixel(x, y)[c] = PhotoSample(Pattern(x + 0.5, y + 0.5, c) / 255);
      }
    }
  }
  const auto undistorted = Undistort(PhotoToU8(photo), camera, d);
  ASSERT_TRUE(undistorted.ok()) << undistorted.status();
  for (int16_t& sample : photo.data) sample -= kPhotoWhite / 2;  // half of them below black
  const auto precise = Undistort(photo, camera, d);
  ASSERT_TRUE(precise.ok()) << precise.status();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      // Where the lens put the ray of this pinhole pixel (OpenCV's documentation).
      const double u = (x + 0.5 - camera.cx) / camera.fx, v = (y + 0.5 - camera.cy) / camera.fy;
      const double r2 = u * u + v * v, radial = 1 + d.k1 * r2 + d.k2 * r2 * r2;
      const double du = u * radial + 2 * d.p1 * u * v + d.p2 * (r2 + 2 * u * u);
      const double dv = v * radial + d.p1 * (r2 + 2 * v * v) + 2 * d.p2 * u * v;
      const double sx = camera.fx * du + camera.cx, sy = camera.fy * dv + camera.cy;
      if (sx < 1 || sy < 1 || sx > camera.width - 1 || sy > camera.height - 1) continue;
      for (int c = 0; c < 3; ++c) {
        // Two roundings and OpenCV's 1/32 px interpolation grid (slope 5 codes per px): below 1.3.
        // Half a pixel of offset would show as 2.5.
        EXPECT_NEAR(undistorted->pixel(x, y)[c], Pattern(sx, sy, c), 1.3) << x << " " << y;
        EXPECT_NEAR(precise->pixel(x, y)[c] / kPhotoCode + 127.5, Pattern(sx, sy, c), 0.3);
      }
    }
  }
}

TEST(Undistort, WithoutDistortionChangesNothing) {
  const ImageU8 photo = TestImage(120, 80);
  EXPECT_EQ(Undistort(photo, TestCamera(), {})->data, photo.data);
  EXPECT_EQ(Undistort(PhotoFromU8(photo), TestCamera(), {})->data, PhotoFromU8(photo).data);
}

TEST(Undistort, ItsMaskIsWhatThePhotoHas) {
  const Camera camera = TestCamera();
  const Distortion outward{.k1 = 0.1, .p1 = 0.01};
  const auto mask = MaskOfUndistorted(camera, outward);
  ASSERT_TRUE(mask.ok()) << mask.status();
  ASSERT_EQ(mask->width, camera.width);
  int masked = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const auto seen =
          Distort(outward, (x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
      const double sx = camera.fx * seen[0] + camera.cx, sy = camera.fy * seen[1] + camera.cy;
      // How far inside the photo, px.
      const double in = std::min({sx, sy, camera.width - sx, camera.height - sy});
      masked += in < 0;
      if (std::abs(in) < 0.02) continue;  // OpenCV rounds places
      EXPECT_EQ(mask->data[size_t(y) * camera.width + x], in > 0 ? 255 : 0) << x << " " << y;
    }
  }
  EXPECT_GT(masked, 100);
  EXPECT_TRUE(MaskOfUndistorted(camera, {.k1 = -0.1})->empty());
  EXPECT_TRUE(MaskOfUndistorted(camera, {})->empty());
  EXPECT_EQ(Reason(MaskOfUndistorted(camera, {.k1 = NAN}).status()), "NOT_FINITE");
}

// Where its curve no longer rises, a lens would show again what lies farther in.
TEST(Undistort, BeyondWhereTheCurveRisesNothingCounts) {
  Camera camera = TestCamera();
  camera.fx = camera.fy = 36;  // wide: the corners lie at 2.05
  struct Lens {
    Distortion distortion;
    double fold;
  };
  for (const Lens& lens : {Lens{{.k1 = -0.3}, std::sqrt(1 / 0.9)},
                           Lens{{.k1 = -0.5, .k2 = 0.1}, 1},  // and rises again from 1.41
                           Lens{{.k1 = -0.3, .fisheye = true}, std::tan(std::sqrt(1 / 0.9))}}) {
    const Distortion& d = lens.distortion;
    const auto mask = MaskOfUndistorted(camera, d);
    ASSERT_TRUE(mask.ok()) << mask.status();
    ASSERT_FALSE(mask->empty());
    Planes ones(1, camera.height, camera.width);
    std::fill(ones.data.begin(), ones.data.end(), 1.0f);
    const auto depth = UndistortNearest(ones, camera, d);
    ASSERT_TRUE(depth.ok()) << depth.status();
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const double r =
            std::hypot((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
        if (std::abs(r - lens.fold) < 1e-6) continue;
        const size_t i = size_t(y) * camera.width + x;
        EXPECT_EQ(mask->data[i], r < lens.fold ? 255 : 0) << x << " " << y;
        EXPECT_EQ(depth->data[i], r < lens.fold ? 1 : 0) << x << " " << y;
      }
    }
    EXPECT_EQ(mask->data[0], 0);
    EXPECT_TRUE(Undistort(TestImage(120, 80), camera, d).ok());
  }
}

TEST(Undistort, RefusesOtherSizesAndNaN) {
  EXPECT_EQ(Reason(Undistort(TestImage(60, 40), TestCamera(), {}).status()), "SIZE_MISMATCH");
  EXPECT_EQ(Reason(Undistort(ImageU8(), TestCamera(), {}).status()), "SIZE_MISMATCH");
  EXPECT_EQ(Reason(Undistort(TestImage(120, 80), TestCamera(), {.k1 = NAN}).status()),
            "NOT_FINITE");
}

TEST(Undistort, SurvivesAbsurdCoefficients) {
  for (double k : {1e10, -1e10, 1e300}) {
    const auto image = Undistort(TestImage(120, 80), TestCamera(), {.k1 = k, .p1 = k});
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->width, 120);
  }
}

// Both files describe the same cameras (see the README of the photo sets).
TEST(ReadCameras, TransformsAndColmapAgreeOnRealData) {
  const std::string scenes = SharedScenes();
  if (scenes.empty()) GTEST_SKIP() << "no shared/scenes beside the source tree";
  const std::string fox = scenes + "/fox/";
  const auto json = ReadCameras(fox + "transforms_train.json", "cameras");
  ASSERT_TRUE(json.ok()) << json.status();
  const auto colmap = ReadCameras(fox + "colmap_sparse/0", "cameras");
  ASSERT_TRUE(colmap.ok()) << colmap.status();
  EXPECT_EQ(json->views.size(), 44u);
  EXPECT_EQ(colmap->views.size(), 50u);
  EXPECT_GT(colmap->points.size(), 1000u);
  size_t matched = 0;
  for (const View& view : json->views) {
    for (const View& other : colmap->views) {
      if (view.name != other.name) continue;
      ++matched;
      // The same numbers up to the rounding of quaternion and matrix inverse in double.
      for (int i = 0; i < 9; ++i) EXPECT_NEAR(view.camera.R[i], other.camera.R[i], 1e-9);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(view.camera.t[i], other.camera.t[i], 1e-9);
      EXPECT_NEAR(view.camera.fx, other.camera.fx, 1e-6);  // COLMAP's has six decimals
      EXPECT_EQ(view.camera.width, other.camera.width);
    }
  }
  EXPECT_EQ(matched, 44u);
}

TEST(ReadCameras, PointsProjectToTheirObservationsOnRealData) {
  const std::string scenes = SharedScenes();
  if (scenes.empty()) GTEST_SKIP() << "no shared/scenes beside the source tree";
  for (const char* scene : {"fox", "castle"}) {
    const auto model = ReadCameras(scenes + "/" + scene + "/colmap_sparse/0", "cameras");
    ASSERT_TRUE(model.ok()) << model.status();
    double sum = 0;
    int n = 0;
    for (const SparsePoint& point : model->points) {
      EXPECT_GE(point.track_length(), 2);
      for (const TrackElement& e : point.track) {
        const Camera& c = model->views[e.view].camera;
        const auto p = c.CamFromWorld(point.xyz);
        ASSERT_GT(p[2], 0);
        sum += std::hypot(c.fx * p[0] / p[2] + c.cx - e.x, c.fy * p[1] / p[2] + c.cy - e.y);
        ++n;
      }
    }
    // COLMAP keeps observations below 4 px and fits them to well under one.
    EXPECT_LT(sum / n, 1.0) << scene;
  }
}

TEST(ReadCameras, NamesAMissingPath) {
  const absl::Status status = ReadCameras("/nonexistent/transforms.json", "cameras").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), testing::StartsWith("cameras: "));
}

}  // namespace
}  // namespace litags
