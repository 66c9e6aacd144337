#include "engine/pipeline/dense_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/mask.h"
#include "engine/io/container.h"
#include "engine/io/container_test_util.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

Photo RampTarget(int width, int height) {
  ImageU8 codes(width, height);
  for (size_t i = 0; i < codes.data.size(); ++i) codes.data[i] = i % 251;
  return PhotoFromU8(codes);
}

// A photo whose pixels all lie on the plane z = 2 + x / 10 of its camera.
struct Plane {
  static constexpr int kWide = 40, kHigh = 30;
  View view;
  litags::Photo target = RampTarget(kWide, kHigh);
  PlaneU8 mask;
  DepthMap map;
  PosedPhoto posed{&view, nullptr, &target, nullptr, &mask};

  Plane() {
    view.camera = RingCamera(1, 5, kWide, kHigh);
    map.depth = map.confidence = Planes(1, kHigh, kWide);
    std::fill(map.confidence.data.begin(), map.confidence.data.end(), 0.9f);
    for (int y = 0; y < kHigh; ++y) {
      for (int x = 0; x < kWide; ++x) {
        const Camera& c = view.camera;
        map.depth.at(0, y, x) = static_cast<float>(2 / (1 - 0.1 * (x + 0.5 - c.cx) / c.fx));
      }
    }
  }
  Plane(const Plane&) = delete;
  PhotoDepth Photo() const { return {&posed, &map}; }
};

TEST(PointsOfDepth, LieWhereThePixelsSeeThem) {
  const Plane plane;
  const auto points = PointsOfDepth({plane.Photo()}, Plane::kWide * Plane::kHigh);
  ASSERT_EQ(points.size(), size_t{Plane::kWide * Plane::kHigh});
  const Camera& camera = plane.view.camera;
  for (const int i : {0, 41, 1199}) {
    const auto p = camera.CamFromWorld(points[i].xyz);
    EXPECT_NEAR(p[2], 2 + 0.1 * p[0], 1e-6);
    EXPECT_NEAR(camera.fx * p[0] / p[2] + camera.cx, i % Plane::kWide + 0.5, 1e-9);
    EXPECT_NEAR(camera.fy * p[1] / p[2] + camera.cy, i / Plane::kWide + 0.5, 1e-9);
    EXPECT_EQ(points[i].rgb[1], (3 * i + 1) % 251);
    EXPECT_TRUE(points[i].track.empty());
  }
}

TEST(PointsOfDepth, HaveCodesOfTargetsThatLeaveTheirRange) {
  Plane plane;
  const int16_t samples[] = {-40, kPhotoWhite + 200, kPhotoWhite - 1};
  std::copy_n(samples, 3, plane.target.data.begin());
  const auto points = PointsOfDepth({plane.Photo()}, Plane::kWide * Plane::kHigh);
  EXPECT_EQ(points[0].rgb, (std::array<uint8_t, 3>{0, 255, 255}));
}

TEST(PointsOfDepth, AMapMayBeSmallerThanItsPhoto) {
  Plane plane;
  Camera& camera = plane.view.camera;
  camera = camera.Scaled(2 * Plane::kWide, 2 * Plane::kHigh);
  plane.target = RampTarget(2 * Plane::kWide, 2 * Plane::kHigh);
  plane.mask = PlaneU8(2 * Plane::kWide, 2 * Plane::kHigh);
  std::fill(plane.mask.data.begin(), plane.mask.data.end(), kCounts);
  plane.mask.data[1 * 2 * Plane::kWide + 3] = 0;  // under the map's (1, 0)
  const auto points = PointsOfDepth({plane.Photo()}, 1 << 20);
  ASSERT_EQ(points.size(), 1199u);
  const auto p = camera.CamFromWorld(points[1].xyz);  // (2, 0)
  EXPECT_NEAR(p[2], plane.map.depth.at(0, 0, 2), 1e-6);
  EXPECT_NEAR(camera.fx * p[0] / p[2] + camera.cx, 5, 1e-9);
  EXPECT_NEAR(camera.fy * p[1] / p[2] + camera.cy, 1, 1e-9);
  EXPECT_EQ(points[1].rgb[2], PhotoToU8(plane.target).pixel(5, 1)[2]);
}

TEST(PointsOfDepth, AreAGridOfAtMostTheLimitOverAllPhotos) {
  const Plane a, b;
  EXPECT_EQ(PointsOfDepth({a.Photo(), b.Photo()}, 2400).size(), 2400u);
  EXPECT_EQ(PointsOfDepth({a.Photo(), b.Photo()}, 2399).size(), 600u);  // every second
  EXPECT_EQ(PointsOfDepth({a.Photo(), b.Photo()}, 600).size(), 600u);
  // Pixels (1, 1), (4, 1) ...: 13 of 40 columns, 10 of 30 rows.
  const auto third = PointsOfDepth({a.Photo()}, 140);
  ASSERT_EQ(third.size(), 130u);
  EXPECT_EQ(third[1].rgb[0], PhotoToU8(a.target).pixel(4, 1)[0]);
  EXPECT_TRUE(PointsOfDepth({a.Photo()}, 0).empty());
  EXPECT_TRUE(PointsOfDepth({a.Photo()}, -5).empty());
  EXPECT_TRUE(PointsOfDepth({}, 100).empty());
}

TEST(PointsOfDepth, DoubtfulAndMaskedPixelsGiveNone) {
  Plane plane;
  for (int x = 0; x < 10; ++x) plane.map.confidence.at(0, 3, x) = 0.49f;
  plane.mask = PlaneU8(Plane::kWide, Plane::kHigh);
  std::fill(plane.mask.data.begin(), plane.mask.data.end(), kCounts);
  for (int x = 20; x < 25; ++x) plane.mask.data[7 * Plane::kWide + x] = 0;
  EXPECT_EQ(PointsOfDepth({plane.Photo()}, 1 << 20).size(), 1200u - 10 - 5);
}

ReconstructOptions DenseOptions() {
  ReconstructOptions options = SmallOptions();
  options.recipe->dense_start = true;
  return options;
}

std::string Start(const ReconstructInput& input) { return input.work_dir + "/start.litags"; }

TEST(DenseStart, PointsAreMadeOnceAndKept) {
  Photographs photos;
  const ReconstructInput input = photos.Input("work");
  ReconstructOptions options = DenseOptions();
  const auto report = Reconstruct(input, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("training starts from 150 sparse points and ")));
  EXPECT_THAT(report->notes, Not(Contains(HasSubstr(" and 0 of stereo depth"))));
  EXPECT_EQ(report->sparse_points, 150);
  EXPECT_GT(report->gaussians, 200);
  EXPECT_FALSE(report->depth_used) << "the depth loss is another matter";

  const std::string kept = Bytes(Start(input));
  const auto time = std::filesystem::last_write_time(Start(input));
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_EQ(std::filesystem::last_write_time(Start(input)), time) << "made again";
  // Damaged: made again, the same.
  ASSERT_TRUE(WriteFileAtomically(Start(input), kept.substr(0, kept.size() / 2)).ok());
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_TRUE(Bytes(Start(input)) == kept);
  // Of an older version, too.
  RewriteAsVersion(Start(input), "start points", 0);
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_TRUE(Bytes(Start(input)) == kept);
  // Of other photos, cameras, points or another limit: others.
  options.max_gaussians = 150 * 16 + 160;
  const auto fewer = Reconstruct(photos.Input("fewer"), options);
  ASSERT_TRUE(fewer.ok());
  EXPECT_LE(fewer->gaussians, report->gaussians);
  for (SparsePoint& point : photos.model.points) point.xyz[1] += 0.1;
  photos.WriteModel();
  ASSERT_TRUE(Reconstruct(input, DenseOptions()).ok());
  EXPECT_FALSE(Bytes(Start(input)) == kept) << "those of other points were used";
}

TEST(DenseStart, StereoOfFewerPhotosGivesOtherPoints) {
  const Photographs photos;
  for (const DepthOrigin source : {DepthOrigin::kNone, DepthOrigin::kAuto}) {
    const ReconstructInput input = photos.Input("work" + std::string(FieldText(source)));
    ReconstructOptions options = DenseOptions();
    options.iterations = 2;
    options.depth_source = source;
    ASSERT_TRUE(Reconstruct(input, options).ok());
    const std::string kept = Bytes(Start(input));
    options.recipe->stereo_photos = 3;
    ASSERT_TRUE(Reconstruct(input, options).ok());
    EXPECT_FALSE(Bytes(Start(input)) == kept) << "those of all photos were used";
  }
}

TEST(DenseStart, TwoThreadsGiveTheSameScene) {
  const Photographs photos;
  ReconstructOptions options = DenseOptions();
  options.depth_source = DepthOrigin::kAuto;  // the loss's maps, too
  const ReconstructInput one = photos.Input("one"), two = photos.Input("two");
  ASSERT_TRUE(Reconstruct(one, options).ok());
  options.threads = 2;
  ASSERT_TRUE(Reconstruct(two, options).ok());
  EXPECT_TRUE(Bytes(Start(one)) == Bytes(Start(two)));
  EXPECT_TRUE(SceneBytes(one) == SceneBytes(two));
}

// Mean distance of the points of stereo from the origin, where the cloud is.
double MeanDistance(const ReconstructInput& input) {
  const auto file = Container::Read(Start(input), "start points", 1, 1);
  EXPECT_TRUE(file.ok()) << file.status();
  const std::vector<double> xyz = file->Array<double>("xyz").value();
  EXPECT_GT(xyz.size(), 300u);
  double sum = 0;
  for (size_t i = 0; i < xyz.size(); i += 3) sum += std::hypot(xyz[i], xyz[i + 1], xyz[i + 2]);
  return sum / (xyz.size() / 3);
}

TEST(DenseStart, LargePhotosGivePointsInTheSamePlaces) {
  const Photographs small(340, 160), large(680, 320);
  ReconstructOptions options = DenseOptions();
  options.iterations = 2;
  const ReconstructInput a = small.Input("work"), b = large.Input("work");
  ASSERT_TRUE(Reconstruct(a, options).ok());
  ASSERT_TRUE(Reconstruct(b, options).ok());
  EXPECT_NEAR(MeanDistance(b) / MeanDistance(a), 1, 0.1);
}

TEST(DenseStart, WithoutItAndWithPlain3dgsOnlyTheSparsePointsStart) {
  const Photographs photos;
  ReconstructOptions off = DenseOptions(), plain = DenseOptions(), full = DenseOptions();
  off.recipe->dense_start = false;
  plain.recipe = Plain3dgs();
  full.max_gaussians = 150 * 16;
  int run = 0;
  for (const ReconstructOptions& options : {off, plain, full}) {
    const ReconstructInput input = photos.Input("work" + std::to_string(run++));
    const auto report = Reconstruct(input, options);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_THAT(report->notes, Not(Contains(HasSubstr("training starts from"))));
    EXPECT_FALSE(std::filesystem::exists(Start(input)));
  }
}

// Share of the scene's Gaussians that are less than a fifth as thick as wide.
double ShareOfDisks(const ReconstructInput& input) {
  const auto file = Container::Read(input.work_dir + "/scene.litags", "scene", 1, 1 << 20);
  EXPECT_TRUE(file.ok()) << file.status();
  const std::vector<float> data = file->Array<float>("splats").value();
  Splats splats(data.size() / Splats::kBlockFloats * kSplatBlock);  // with what fills up blocks
  std::copy(data.begin(), data.end(), splats.block(0));
  double disks = 0;
  for (size_t i = 0; i < splats.size(); ++i) {
    disks += splats.at(i, kLogScale + 2) < splats.at(i, kLogScale) + std::log(0.2);
  }
  return disks / splats.size();
}

TEST(DenseStart, GaussiansStartAsDisksWithItAlone) {
  const Photographs photos;
  ReconstructOptions with = DenseOptions(), off = DenseOptions(), plain = DenseOptions();
  with.iterations = off.iterations = plain.iterations = 1;
  off.recipe->dense_start = false;
  plain.recipe = Plain3dgs();
  const ReconstructInput input = photos.Input("with");
  ASSERT_TRUE(Reconstruct(input, with).ok());
  EXPECT_GT(ShareOfDisks(input), 0.2);
  int run = 0;
  for (const ReconstructOptions& options : {off, plain}) {
    const ReconstructInput other = photos.Input("work" + std::to_string(run++));
    ASSERT_TRUE(Reconstruct(other, options).ok());
    EXPECT_EQ(ShareOfDisks(other), 0);
  }
}

TEST(DenseStart, DepthOfTheLossIsNotMadeTwice) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  ReconstructOptions options = DenseOptions();
  Recorder recorder;
  int stereo = 0, start = 0;
  recorder.on_progress = [&](const Progress& p) {
    stereo += p.message.find("depth by stereo") != std::string::npos;
    start += p.message.find("points to start from") != std::string::npos;
  };
  for (const DepthOrigin source : {DepthOrigin::kAuto, DepthOrigin::kStereo}) {
    options.depth_source = source;
    stereo = 0;
    ASSERT_TRUE(MakeEngine(kNoColmap)->Reconstruct(input, options, CancelToken(), &recorder).ok());
    EXPECT_GT(stereo, 0);
    EXPECT_EQ(start, 0);
    EXPECT_FALSE(Bytes(Start(input)).empty());
  }
  // Without that loss they are made for themselves.
  options.depth_source = DepthOrigin::kNone;
  ASSERT_TRUE(MakeEngine(kNoColmap)->Reconstruct(input, options, CancelToken(), &recorder).ok());
  EXPECT_GT(start, 0) << "points of the loss's depth were used";
}

}  // namespace
}  // namespace litags
