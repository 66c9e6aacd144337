// Panoramas of the sample room through the real COLMAP.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "engine/core/color.h"
#include "engine/io/image_io.h"
#include "engine/io/panorama.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/panorama_views.h"
#include "engine/sample/tracer.h"
#include "engine/sample/world.h"
#include "engine/sfm/sfm.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 1400, kSide = 446, kPlaces = 5;  // px, of the panoramas and their views

// A camera that looks level along an axis of the room, whose up is z, turned by `view`.
Camera CameraAt(const Eigen::Vector3d& eye, const PanoramaView& view) {
  Eigen::Matrix3d level;  // panorama from world
  level << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const Eigen::Matrix3d R =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(view.R.data()).transpose() *
      level;
  const Eigen::Vector3d t = -R * eye;
  Camera camera = {.width = kSide,
                   .height = kSide,
                   .fx = kSide / 2.0,
                   .fy = kSide / 2.0,
                   .cx = kSide / 2.0,
                   .cy = kSide / 2.0};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) camera.R[3 * i + j] = R(i, j);
    camera.t[i] = t[i];
  }
  return camera;
}

// What a camera for 360 degrees writes, from the six views: each pixel from the view that sees it.
ImageU8 Panorama(const std::vector<Planes>& views) {
  ImageU8 out(kWidth, kWidth / 2);
  for (int y = 0; y < out.height; ++y) {
    const double down = ((y + 0.5) / out.height - 0.5) * std::numbers::pi;
    for (int x = 0; x < kWidth; ++x) {
      const double right = ((x + 0.5) / kWidth * 2 - 1) * std::numbers::pi;
      const Eigen::Vector3d ray(std::cos(down) * std::sin(right), std::sin(down),
                                std::cos(down) * std::cos(right));
      for (size_t v = 0; v < views.size(); ++v) {
        const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(
            kPanoramaViews[v].R.data());
        const Eigen::Vector3d seen = R.transpose() * ray;
        if (seen.z() < 0.999 * seen.cwiseAbs().maxCoeff()) continue;
        const auto pixel = [](double tangent) {
          return std::clamp(static_cast<int>((tangent + 1) / 2 * kSide), 0, kSide - 1);
        };
        const int from_x = pixel(seen.x() / seen.z()), from_y = pixel(seen.y() / seen.z());
        for (int c = 0; c < 3; ++c) {
          const double code = 255 * SrgbFromLinear(0.5 * views[v].at(c, from_y, from_x));
          out.pixel(x, y)[c] = static_cast<uint8_t>(std::clamp(std::lround(code), 0L, 255L));
        }
      }
    }
  }
  return out;
}

TEST(Panoramas, OfAWalkGiveTheCamerasOfTheirViews) {
  const TempDir dir;
  ReconstructInput input;
  input.images_dir = dir / "photos";
  input.work_dir = dir / "work";
  fs::create_directory(input.images_dir);
  fs::create_directory(input.work_dir);
  const sample::World world = sample::MakeRoom(0);
  std::vector<Eigen::Vector3d> eyes;
  for (int i = 0; i < kPlaces; ++i) {
    eyes.emplace_back(1.2 * std::sin(0.5 * (i - 2)), -1.4 * std::cos(0.5 * (i - 2)),
                      1.3 + 0.1 * (i % 2));
    std::vector<Planes> views;
    for (const PanoramaView& view : kPanoramaViews) {
      views.push_back(
          sample::TraceRadiance(world, CameraAt(eyes.back(), view), {.grid = 2, .seed = 1}));
    }
    ASSERT_TRUE(WritePng(dir / ("photos/" + std::to_string(i) + ".png"), Panorama(views)).ok());
  }
  std::vector<std::string> notes;
  const auto cut = WithViewsOfPanoramas(
      input, 0, CancelToken(), [](const std::string&) {}, &notes);
  ASSERT_TRUE(cut.ok()) << cut.status();
  SfmOptions options;
  options.rig_views = cut->rig_views;
  const auto found = FindCameras(cut->images_dir, dir / "sfm", options, CancelToken());
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(found->model.views.size(), 6 * kPlaces);

  Eigen::Matrix3Xd from(3, found->model.views.size()), to = from;
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    const View& view = found->model.views[static_cast<size_t>(i)];
    from.col(i) = Eigen::Vector3d(view.camera.Center().data());
    to.col(i) = eyes[static_cast<size_t>(view.name[0] - '0')];
    EXPECT_NEAR(view.camera.fx / (kSide / 2.0), 1, 0.01);
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to);
  const Eigen::Matrix3Xd off = (similarity * from.colwise().homogeneous()).topRows(3) - to;
  EXPECT_LT(off.colwise().norm().maxCoeff(), 0.05);  // m
}

}  // namespace
}  // namespace litags
