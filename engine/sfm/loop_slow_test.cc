// The real COLMAP on a walk that comes back to its start, as a large capture.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/sample/exposure.h"
#include "engine/sample/tracer.h"
#include "engine/sample/world.h"
#include "engine/sfm/sfm.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 320, kHeight = 240;  // px

// LITAGS_LOOP_PHOTOS=210 takes more, for figures.
int Photos() {
  const char* const wanted = std::getenv("LITAGS_LOOP_PHOTOS");
  return wanted == nullptr ? 48 : std::max(48, std::atoi(wanted));
}

// Once around the table, looking outwards: a photo shares nothing with those across the room.
Camera OnTheWay(int i, int photos) {
  const double angle = 2 * std::numbers::pi * i / photos, radius = 0.9 + 0.15 * std::sin(3 * angle);
  const std::array<double, 3> eye = {radius * std::sin(angle), -radius * std::cos(angle),
                                     1.35 + 0.15 * std::sin(5 * angle)};
  Camera camera = {.width = kWidth, .height = kHeight, .fx = 270, .fy = 270};
  camera.cx = kWidth / 2.0;
  camera.cy = kHeight / 2.0;
  EXPECT_TRUE(camera.LookAt(eye, {3 * eye[0], 3 * eye[1], eye[2] - 0.1}, {0, 0, 1}).ok());
  return camera;
}

// Names tell nothing of the order.
std::string NameOf(int i, int photos) { return std::to_string(1000 + i * 31 % photos) + ".png"; }

TEST(Loop, OfAWalkThatComesBackIsClosed) {
  const int photos = Photos();
  const TempDir dir;
  fs::create_directory(dir / "photos");
  const sample::World world = sample::MakeRoom(0);
  std::vector<std::array<double, 3>> place(static_cast<size_t>(photos));
  for (int i = 0; i < photos; ++i) {
    const Camera camera = OnTheWay(i, photos);
    place[static_cast<size_t>(i)] = camera.Center();
    const Planes light = sample::TraceRadiance(world, camera, {.grid = 2, .seed = 1});
    const ImageU8 photo = sample::NormalPhoto(light, /*white=*/2);
    ASSERT_TRUE(WritePng(dir / ("photos/" + NameOf(i, photos)), photo).ok());
  }
  SfmOptions options;
  options.match_all_up_to = std::min(options.match_all_up_to, photos - 1);
  if (photos <= 200) options.similar_photos = 10;  // else these would be nearly all
  const auto found = FindCameras(dir / "photos", dir / "work", options, CancelToken());
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->model.views.size(), static_cast<size_t>(photos));

  Eigen::Matrix3Xd from(3, photos), to(3, photos);
  for (int i = 0; i < photos; ++i) {
    const std::string name = NameOf(i, photos);
    const auto view = std::find_if(found->model.views.begin(), found->model.views.end(),
                                   [&](const View& v) { return v.name == name; });
    ASSERT_NE(view, found->model.views.end());
    from.col(i) = Eigen::Vector3d(view->camera.Center().data());
    to.col(i) = Eigen::Vector3d(place[static_cast<size_t>(i)].data());
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to);
  const Eigen::Matrix3Xd placed = (similarity * from.colwise().homogeneous()).topRows(3);
  const double off = (placed - to).colwise().norm().mean();
  const double seam =
      ((placed.col(0) - placed.col(photos - 1)) - (to.col(0) - to.col(photos - 1))).norm();
  const SfmRung& rung = found->rungs.back();
  std::printf(
      "%d photos: off by %.4f m, at the seam %.4f m; %zu points; s: prepare %.0f, features "
      "%.0f, match %.0f, verify %.0f, map %.0f\n",
      photos, off, seam, found->model.points.size(), rung.prepare_seconds, rung.feature_seconds,
      rung.match_seconds, rung.verify_seconds, rung.map_seconds);
  EXPECT_LT(off, 0.02);   // m, of a way of 6 m
  EXPECT_LT(seam, 0.02);  // m
}

}  // namespace
}  // namespace litags
