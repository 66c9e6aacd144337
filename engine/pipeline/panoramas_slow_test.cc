// Panoramas and fisheyes of the sample room through the real COLMAP.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/cameras_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/sparse_model.h"
#include "engine/io/transforms_io.h"
#include "engine/io/wide_lens.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/turned_view.h"
#include "engine/pipeline/wide_views.h"
#include "engine/sample/exposure.h"
#include "engine/sample/tracer.h"
#include "engine/sample/world.h"
#include "engine/sfm/sfm.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 1400, kSide = 446, kPlaces = 5;  // px, of the panoramas and their views

using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// A camera that looks level along an axis of the room, whose up is z.
Camera LevelCamera(const Eigen::Vector3d& eye, int width, int height, double focal_length) {
  Camera camera = {.width = width,
                   .height = height,
                   .fx = focal_length,
                   .fy = focal_length,
                   .cx = width / 2.0,
                   .cy = height / 2.0};
  Rotation level;  // camera from world
  level << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  Eigen::Map<Rotation>(camera.R.data()) = level;
  Eigen::Map<Eigen::Vector3d>(camera.t.data()) = -level * eye;
  return camera;
}

Eigen::Vector3d Place(int i) {
  return {1.2 * std::sin(0.5 * (i - 2)), -1.4 * std::cos(0.5 * (i - 2)), 1.3 + 0.1 * (i % 2)};
}

// A fisheye of 180 degrees whose circle, equidistant, fills the shorter side of the camera's
// picture.
sample::TraceOptions OfFisheye(const Camera& camera) {
  sample::TraceOptions options = {.grid = 2, .seed = 1};
  const double radius = 0.5 * std::min(camera.width, camera.height);
  const double x0 = camera.cx, y0 = camera.cy;
  options.lens = [radius, x0, y0](double x, double y) -> std::optional<std::array<double, 3>> {
    const double r = std::hypot(x - x0, y - y0), angle = 0.5 * std::numbers::pi * r / radius;
    if (r > radius) return std::nullopt;
    const double scale = r > 0 ? std::sin(angle) / r : 0;
    return std::array{scale * (x - x0), scale * (y - y0), std::cos(angle)};
  };
  return options;
}

// A panorama of the whole sphere, equirectangular.
sample::TraceOptions OfPanorama(const Camera& camera) {
  sample::TraceOptions options = {.grid = 2, .seed = 1};
  const double width = camera.width, height = camera.height;
  options.lens = [width, height](double x, double y) -> std::optional<std::array<double, 3>> {
    const double right = 2 * std::numbers::pi * (x / width - 0.5);
    const double down = std::numbers::pi * (y / height - 0.5);
    return std::array{std::cos(down) * std::sin(right), std::sin(down),
                      std::cos(down) * std::cos(right)};
  };
  return options;
}

// Of the room's radiance, that is white in its photos.
constexpr double kWhite = 2;

TEST(Panoramas, OfAWalkGiveTheCamerasOfTheirViews) {
  const TempDir dir;
  ReconstructInput input;
  input.images_dir = dir / "photos";
  input.work_dir = dir / "work";
  fs::create_directory(input.images_dir);
  fs::create_directory(input.work_dir);
  const sample::World world = sample::MakeRoom(0);
  for (int i = 0; i < kPlaces; ++i) {
    const Camera camera = LevelCamera(Place(i), kWidth, kWidth / 2, kWidth);
    const Planes light = sample::TraceRadiance(world, camera, OfPanorama(camera));
    ASSERT_TRUE(
        WritePng(dir / ("photos/" + std::to_string(i) + ".png"), sample::NormalPhoto(light, kWhite))
            .ok());
  }
  std::vector<std::string> notes;
  const auto cut = WithViewsOfWidePhotos(
      CutInput(input), 0, CancelToken(), [](const std::string&) {}, &notes);
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
    to.col(i) = Place(view.name[0] - '0');
    EXPECT_NEAR(view.camera.fx / (kSide / 2.0), 1, 0.01);
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to);
  const Eigen::Matrix3Xd off = (similarity * from.colwise().homogeneous()).topRows(3) - to;
  EXPECT_LT(off.colwise().norm().maxCoeff(), 0.05);  // m
}

// Eight fisheyes of 180 degrees on the way, with their cameras.
class Fisheyes : public ::testing::Test {
 protected:
  static constexpr int kFisheyes = 8, kRound = 300;  // px

  void SetUp() override {
    input_.images_dir = dir_ / "photos";
    input_.work_dir = dir_ / "work";
    input_.cameras_path = dir_ / "transforms.json";
    fs::create_directory(input_.images_dir);
    fs::create_directory(input_.work_dir);
    SparseModel model;
    for (int i = 0; i < kFisheyes; ++i) {
      const Camera camera = LevelCamera(Place(i - 2), kRound, kRound, kRound / std::numbers::pi);
      const Planes light = sample::TraceRadiance(world_, camera, OfFisheye(camera));
      model.views.push_back({std::to_string(i) + ".png", camera});
      model.distortions.push_back({.fisheye = true});
      ASSERT_TRUE(WritePng(input_.images_dir + "/" + model.views.back().name,
                           sample::NormalPhoto(light, kWhite))
                      .ok());
    }
    ASSERT_TRUE(WriteTransforms(input_.cameras_path, model, "").ok());
  }

  // What a pinhole camera sees that looks to the side from between two of the places.
  Camera ToTheSide() const {
    return TurnedView(LevelCamera(0.5 * (Place(1) + Place(2)), 96, 96, 48), kCubeViews[1], 96);
  }

  // Whether a fisheye there shows its pixel at the rim, 62 to 88 degrees off the axis.
  static bool AtTheRim(int x, int y) {
    const double u = (x + 0.5) / 48 - 1, v = (y + 0.5) / 48 - 1;
    const double cosine = -u / std::hypot(u, v, 1);
    return cosine > std::cos(88 * std::numbers::pi / 180) &&
           cosine < std::cos(62 * std::numbers::pi / 180);
  }

  const TempDir dir_;
  const sample::World world_ = sample::MakeRoom(0);
  ReconstructInput input_;
};

TEST_F(Fisheyes, ViewsAreWhatPinholeCamerasSee) {
  std::vector<std::string> notes;
  const auto cut = WithViewsOfWidePhotos(
      CutInput(input_), 0, CancelToken(), [](const std::string&) {}, &notes);
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_THAT(notes, testing::Contains("8 photos are fisheyes, such as 0.png: 5 views of each are "
                                       "the photos"));
  const auto cameras = ReadCameras(cut->cameras_path, "cameras");
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_EQ(cameras->views.size(), 5u * kFisheyes);
  for (const size_t i : {0, 1, 2, 3, 4}) {  // of one place
    const View& view = cameras->views[i];
    const ImageU8 truth = sample::NormalPhoto(
        sample::TraceRadiance(world_, view.camera, {.grid = 2, .seed = 2}), kWhite);
    const auto photo =
        ReadMaskedPhoto(cut->images_dir + "/" + view.name, view.name,
                        view.name == "0_front.png" ? "" : cut->masks_dir + "/" + view.name);
    ASSERT_TRUE(photo.ok()) << photo.status();
    double error = 0;
    double counted = 0;
    for (size_t p = 0; p < truth.data.size(); ++p) {
      if (!photo->mask.empty() && photo->mask.data[p / 3] == 0) continue;
      error += std::pow(truth.data[p] - photo->photo.data[p] / double{kPhotoCode}, 2);
      ++counted;
    }
    EXPECT_GT(counted, 0.48 * static_cast<double>(truth.data.size())) << view.name;
    // Two drawings of the same noise and a resampling; a camera turned by a degree has 23 dB.
    EXPECT_GT(10 * std::log10(255.0 * 255 * counted / error), 27) << view.name;
  }
}

TEST_F(Fisheyes, AreLearntToTheirRim) {
  ReconstructOptions options;
  options.iterations = 600;
  options.recipe = Litags();
  options.recipe->dense_start = false;  // a minute
  const auto engine = MakeEngine();
  const auto report = engine->Reconstruct(input_, options, CancelToken(), nullptr);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->registered, 5 * kFisheyes);
  const auto scene = engine->LoadScene(input_.work_dir + "/scene.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  RenderRequest request;
  request.camera = ToTheSide();
  request.channel = Channel::kOriginal;
  const auto picture = (*scene)->Render(request);
  ASSERT_TRUE(picture.ok()) << picture.status();
  const ImageU8 truth = sample::NormalPhoto(
      sample::TraceRadiance(world_, request.camera, {.grid = 3, .seed = 2}), kWhite);
  double error = 0, counted = 0;
  for (int y = 0; y < truth.height; ++y) {
    for (int x = 0; x < truth.width; ++x) {
      if (!AtTheRim(x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        error += std::pow(truth.pixel(x, y)[c] / 255.0 - picture->at(c, y, x), 2);
        ++counted;
      }
    }
  }
  EXPECT_GT(-10 * std::log10(error / counted), 18.5);  // dB
}

// Around the table, up and down, as one holds a camera: level photos on a line tell no focal
// length.
Camera HandHeld(int i, int count, int size) {
  const double a = 1.6 * std::numbers::pi * i / count;
  const double yaw = a + 0.9 + 0.3 * std::sin(2 * a), pitch = 0.15 * std::sin(4 * a) - 0.1;
  const Eigen::Vector3d eye(1.3 * std::sin(a), -1.3 * std::cos(a), 1.3 + 0.25 * std::sin(3 * a));
  const Eigen::Vector3d forward(std::cos(pitch) * std::cos(yaw), std::cos(pitch) * std::sin(yaw),
                                std::sin(pitch));
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Camera camera = LevelCamera(eye, size, size, size / std::numbers::pi);
  Rotation turned;
  turned << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  Eigen::Map<Rotation>(camera.R.data()) = turned;
  Eigen::Map<Eigen::Vector3d>(camera.t.data()) = -turned * eye;
  return camera;
}

TEST(Fisheye, IsSolvedWithoutCameras) {
  constexpr int kCount = 16, kSize = 400;  // px
  const TempDir dir;
  ReconstructInput input;
  input.images_dir = dir / "photos";
  input.work_dir = dir / "work";
  fs::create_directory(input.images_dir);
  fs::create_directory(input.work_dir);
  const sample::World world = sample::MakeRoom(0);
  Eigen::Matrix3Xd places(3, kCount);
  for (int i = 0; i < kCount; ++i) {
    const Camera camera = HandHeld(i, kCount, kSize);
    places.col(i) = Eigen::Vector3d(camera.Center().data());
    const Planes light = sample::TraceRadiance(world, camera, OfFisheye(camera));
    ASSERT_TRUE(WritePng(absl::StrFormat("%s/%02d.png", input.images_dir, i),
                         sample::NormalPhoto(light, kWhite))
                    .ok());
  }
  ReconstructOptions options;
  options.iterations = 2;
  options.recipe = Litags();
  options.recipe->dense_start = false;  // a minute
  const auto report = MakeEngine()->Reconstruct(input, options, CancelToken(), nullptr);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->registered, 5 * kCount);
  EXPECT_EQ(report->dropped, std::vector<std::string>());
  EXPECT_THAT(report->notes, testing::Contains(testing::HasSubstr("the lens is a fisheye")));
  EXPECT_NE(report->sfm_preparation, "given");

  const auto found = ReadCameras(input.work_dir + "/solved_fisheyes", "cameras");
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->views.size(), size_t{kCount});
  Eigen::Matrix3Xd centers(3, kCount);
  for (int i = 0; i < kCount; ++i) {
    const Camera& camera = found->views[static_cast<size_t>(i)].camera;
    centers.col(i) = Eigen::Vector3d(camera.Center().data());
    EXPECT_NEAR(camera.fx / (kSize / std::numbers::pi), 1, 0.01);
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(centers, places);
  const Eigen::Matrix3Xd off = (similarity * centers.colwise().homogeneous()).topRows(3) - places;
  EXPECT_LT(off.colwise().norm().maxCoeff(), 0.02);  // m

  // Kept: a run that goes on needs no COLMAP.
  options.iterations = 3;
  const auto again = MakeEngine("/no/colmap")->Reconstruct(input, options, CancelToken(), nullptr);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->registered, 5 * kCount);
  EXPECT_EQ(again->sfm_preparation, report->sfm_preparation);
}

}  // namespace
}  // namespace litags
