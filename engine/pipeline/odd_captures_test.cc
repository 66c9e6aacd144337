// Captures of every size and with odd photos: each ends in a finite scene with notes that say what
// was odd, or in a refusal that says what to do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/ply.h"
#include "engine/pipeline/capture_test_util.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

// Loads the scene, which refuses numbers that are not finite, and renders every channel from the
// first view. Its mean colour should be that of a normally lit picture, roughly.
void ExpectGoodScene(const absl::StatusOr<ReconstructReport>& report, size_t views) {
  ASSERT_TRUE(report.ok()) << report.status();
  const auto scene = MakeEngine()->LoadScene(report->scene_path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ((*scene)->views().size(), views);
  for (const Channel channel : {Channel::kColor, Channel::kOriginal, Channel::kDepth,
                                Channel::kStructure, Channel::kIllumination, Channel::kNoise}) {
    RenderRequest request;
    request.camera = (*scene)->views()[0].camera;
    request.channel = channel;
    const auto picture = (*scene)->Render(request);
    ASSERT_TRUE(picture.ok()) << picture.status();
    double sum = 0;
    for (const float v : picture->data) {
      ASSERT_TRUE(std::isfinite(v)) << static_cast<int>(channel);
      sum += v;
    }
    if (channel != Channel::kColor) continue;
    EXPECT_GT(sum / picture->data.size(), 0.25);
    EXPECT_LT(sum / picture->data.size(), 0.75);
  }
}

TEST(OddCaptures, AnyNumberOfViewsMakesAScene) {
  for (const int views : {3, 6, 11, 50, 200}) {
    SCOPED_TRACE(views);
    const RoomCapture capture(views);
    const auto report = Train(capture.Input("work"), capture.Options(40));
    ExpectGoodScene(report, views);
    EXPECT_EQ(report->registered, views);
    EXPECT_THAT(report->notes, Not(Contains(HasSubstr("exposures differ"))));
    EXPECT_EQ(std::isfinite(report->psnr_holdout), views >= 16);
    const auto says_so = Contains(HasSubstr("held out to measure quality"));
    EXPECT_EQ(::testing::Value(report->notes, says_so), views < 16);
  }
}

TEST(OddCaptures, AnyHoldoutEveryIsTakenOrSaidToBeTooMany) {
  const RoomCapture capture(8);
  ReconstructOptions options = capture.Options(1);
  options.holdout_every = 2'000'000'000;
  const auto report = Train(capture.Input("work"), options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains("none of the 8 photos is held out to measure quality: with "
                                      "holdout_every 2000000000 it takes 4000000000"));
}

TEST(OddCaptures, TwoViewsAreRefused) {
  const RoomCapture capture(6);
  for (int i = 2; i < 6; ++i) std::filesystem::remove(capture.Path("images/" + capture.Name(i)));
  EXPECT_EQ(Reason(Train(capture.Input("work"), capture.Options(10)).status()), "TOO_FEW_PHOTOS");
}

TEST(OddCaptures, DarkNormalAndBrightPhotosInOneCapture) {
  RoomCapture capture(18);
  capture.SetLight([](int i) { return static_cast<Light>(i % 3); });
  const auto report = Train(capture.Input("work"), capture.Options(60));
  ExpectGoodScene(report, 18);
  EXPECT_THAT(report->notes, Contains(HasSubstr("exposures differ by")));
}

TEST(OddCaptures, PortraitAndLandscapeOfTwoCameras) {
  const RoomCapture capture(9, /*portrait=*/{1, 4, 7});
  const auto report = Train(capture.Input("work"), capture.Options(40));
  ExpectGoodScene(report, 9);
  const auto scene = MakeEngine()->LoadScene(report->scene_path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ((*scene)->views()[0].camera.width, RoomCapture::kWidth);
  EXPECT_EQ((*scene)->views()[1].camera.width, RoomCapture::kHeight);
}

TEST(OddCaptures, BlackAndClippedPhotosAreLeftOutByName) {
  const RoomCapture capture(8);
  ImageU8 clipped(RoomCapture::kWidth, RoomCapture::kHeight);
  capture.SetPhoto(2, clipped);
  std::fill(clipped.data.begin(), clipped.data.end(), 255);
  capture.SetPhoto(5, clipped);
  const auto report = Train(capture.Input("work"), capture.Options(40));
  ExpectGoodScene(report, 6);
  EXPECT_THAT(report->notes, Contains("v002.png is left out: it is of one colour, (0, 0, 0)"));
  EXPECT_THAT(report->notes,
              Contains("v005.png is left out: it is of one colour, (255, 255, 255)"));
}

TEST(OddCaptures, AThumbnailIsLeftOutByName) {
  RoomCapture capture(8);
  capture.SetPhoto(3, ResizeArea(capture.Photo(3, Light::kLow), 3, 2));
  Camera& camera = capture.model.views[3].camera;
  camera.width = 3;
  camera.height = 2;
  camera.fx = camera.fy = camera.fx * 3 / RoomCapture::kWidth;
  camera.cx = 1.5;
  camera.cy = 1;
  const auto report = Train(capture.Input("work"), capture.Options(40));
  ExpectGoodScene(report, 7);
  EXPECT_THAT(report->notes, Contains("v003.png is left out: it is only 3x2 px in size"));
}

// Dust on a lens cap, noise of a white wall.
TEST(OddCaptures, AlmostFlatPhotosAreLeftOutAndTexturelessOnesSpoilNothing) {
  const RoomCapture capture(10);
  ImageU8 black(RoomCapture::kWidth, RoomCapture::kHeight), wall = black;
  black.pixel(10, 10)[1] = 1;
  capture.SetPhoto(1, black);
  for (const int photo : {4, 7}) {
    const CounterRng rng(photo, 1);
    for (size_t i = 0; i < wall.data.size(); ++i) {
      wall.data[i] = static_cast<uint8_t>(20 + rng.Normal(i));
    }
    capture.SetPhoto(photo, wall);
  }
  const auto report = Train(capture.Input("work"), capture.Options(60));
  ExpectGoodScene(report, 9);
  EXPECT_THAT(report->notes, Contains("v001.png is left out: it is of one colour, (0, 0, 0)"));
}

// Kept cameras that somebody changed: they must not be trained with.
TEST(OddCaptures, AKeptCameraOfAnotherSizeThanItsPhotoIsRefused) {
  RoomCapture capture(6);
  const ReconstructInput input = capture.Input("work");
  ASSERT_TRUE(Train(input, capture.Options(10)).ok());
  Camera& camera = capture.model.views[2].camera;
  std::swap(camera.width, camera.height);
  ASSERT_TRUE(WriteColmapModel(input.work_dir + "/cameras", capture.model).ok());
  const absl::Status status = Train(input, capture.Options(10)).status();
  EXPECT_EQ(Reason(status), "CAMERA_SIZE_MISMATCH");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("v002.png: the photo is 64x48 but its camera says 48x64"));
}

TEST(OddCaptures, ACaptureOfClippedPhotosIsRefused) {
  const RoomCapture capture(6);
  ImageU8 clipped(RoomCapture::kWidth, RoomCapture::kHeight);
  std::fill(clipped.data.begin(), clipped.data.end(), 255);
  for (int i = 0; i < 6; ++i) capture.SetPhoto(i, clipped);
  const absl::Status status = Train(capture.Input("work"), capture.Options(10)).status();
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
  EXPECT_THAT(std::string(status.message()), HasSubstr("0 of 6 photos"));
}

// The same room with all positions times `unit`.
absl::StatusOr<ReconstructReport> TrainInUnits(double unit, int views = 6, int iterations = 20) {
  RoomCapture capture(views);
  for (View& view : capture.model.views) {
    for (double& t : view.camera.t) t *= unit;
  }
  for (SparsePoint& point : capture.model.points) {
    for (double& x : point.xyz) x *= unit;
  }
  const auto report = Train(capture.Input("work"), capture.Options(iterations));
  if (report.ok()) ExpectGoodScene(report, views);
  return report;
}

TEST(OddCaptures, UnitsOfLengthAreTheUsersWithinReason) {
  for (const double unit : {1e-3, 0.5, 1e3, 1e9}) {
    const absl::Status status = TrainInUnits(unit).status();
    EXPECT_TRUE(status.ok()) << unit << status;
  }
  EXPECT_EQ(Reason(TrainInUnits(1e-9).status()), "SCENE_TOO_SMALL");
  EXPECT_EQ(Reason(TrainInUnits(1e30).status()), "SCENE_TOO_LARGE");
}

// The points of the others say nothing of these photos: here they lie behind all their cameras.
TEST(OddCaptures, AModelOfManyMorePhotosMakesASceneOfThoseSent) {
  RoomCapture capture(8);
  const SparsePoint behind = [&] {
    SparsePoint point;
    for (int v = 0; v < 3; ++v) {
      const Camera& camera = capture.model.views[v].camera;
      for (int k = 0; k < 3; ++k) point.xyz[k] -= 1000 * camera.R[6 + k];
    }
    point.track = {{6, 1, 1}, {7, 1, 1}};
    return point;
  }();
  for (int v = 0; v < 3; ++v) {
    ASSERT_LT(capture.model.views[v].camera.CamFromWorld(behind.xyz)[2], 0);
  }
  std::erase_if(capture.model.points, [](const SparsePoint& p) { return p.track[0].view > 2; });
  capture.model.points.resize(3 * capture.model.points.size(), behind);
  for (int i = 3; i < 8; ++i) std::filesystem::remove(capture.Path("images/" + capture.Name(i)));
  ExpectGoodScene(Train(capture.Input("work"), capture.Options(20)), 3);
}

// 3DGS draws nothing that is nearer than 0.2 units. In units of 16 m much of the room is.
TEST(OddCaptures, WhatIsNearIsLearntInAnyUnit) {
  const auto usual = TrainInUnits(1, 18, 100), large = TrainInUnits(1 / 16.0, 18, 100);
  ASSERT_TRUE(usual.ok() && large.ok()) << large.status();
  EXPECT_NEAR(large->psnr_holdout, usual->psnr_holdout, 0.5);
}

// Mean difference, relative to the mean of `a`.
double MeanDifference(const Planes& a, const Planes& b) {
  double sum = 0, all = 0;
  for (size_t i = 0; i < a.data.size(); ++i) {
    sum += std::abs(a.data[i] - b.data[i]);
    all += std::abs(a.data[i]);
  }
  return sum / all;
}

// What is seen by views[0].camera of a scene, moved by `offset`.
absl::StatusOr<Planes> RenderFirst(const Scene& scene, const RoomCapture& capture,
                                   const std::array<double, 3>& offset, Channel channel) {
  RenderRequest request;
  request.camera = capture.model.views[0].camera.Moved(offset);
  request.channel = channel;
  return scene.Render(request);
}

// The same room where it is, and in the coordinates of a map.
TEST(OddCaptures, AMapsCoordinatesGiveTheSameScene) {
  const std::array<double, 3> offset = {5e5, 4.6e6, 100}, none = {};
  const RoomCapture near(6);
  RoomCapture far(6);
  for (View& view : far.model.views) view.camera = view.camera.Moved(offset);
  for (SparsePoint& point : far.model.points) {
    for (int k = 0; k < 3; ++k) point.xyz[k] += offset[k];
  }
  const auto near_report = Train(near.Input("work"), near.Options(20));
  const auto far_report = Train(far.Input("work"), far.Options(20));
  ExpectGoodScene(far_report, 6);
  ASSERT_TRUE(near_report.ok()) << near_report.status();
  EXPECT_THAT(far_report->notes,
              Contains(AllOf(HasSubstr("far from the origin"), HasSubstr("--up keep"))));
  EXPECT_THAT(near_report->notes, Not(Contains(HasSubstr("far from the origin"))));

  const auto here = MakeEngine()->LoadScene(near_report->scene_path);
  const auto there = MakeEngine()->LoadScene(far_report->scene_path);
  ASSERT_TRUE(here.ok() && there.ok()) << there.status();
  for (const Channel channel : {Channel::kColor, Channel::kOriginal, Channel::kDepth}) {
    const auto expected = RenderFirst(**here, near, none, channel);
    const auto actual = RenderFirst(**there, near, offset, channel);
    ASSERT_TRUE(expected.ok() && actual.ok()) << actual.status();
    // Rounding decides about a point of stereo here and there; one moves pictures by 0.002.
    EXPECT_LT(MeanDifference(*expected, *actual), 5e-3) << static_cast<int>(channel);
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR((*there)->center()[k], (*here)->center()[k] + offset[k], 1e-6);
    EXPECT_NEAR((*there)->views()[3].camera.Center()[k],
                near.model.views[3].camera.Center()[k] + offset[k], 1e-6);
  }
  // Viewers have floats: positions count from what the file says.
  ASSERT_TRUE((*there)->ExportPly(far.Path("a.ply"), /*light=*/0).ok());
  const auto ply = ReadFile(far.Path("a.ply"), "", int64_t{1} << 28);
  ASSERT_TRUE(ply.ok()) << ply.status();
  EXPECT_THAT(*ply, HasSubstr("\ncomment origin 5000"));
  EXPECT_TRUE(DecodePly(*ply, "a.ply").ok());
}

TEST(OddCaptures, APointAtTheEndOfTheWorldIsDropped) {
  RoomCapture capture(6);
  capture.model.points[0].xyz = {1e200, 0, 0};
  const auto report = Train(capture.Input("work"), capture.Options(20));
  ExpectGoodScene(report, 6);
  EXPECT_THAT(report->notes, Contains(HasSubstr("1 sparse point was dropped")));
}

// A write beyond the limit fails as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    EXPECT_EQ(getrlimit(RLIMIT_FSIZE, &before_), 0);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {bytes, before_.rlim_max};
    EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_;
  void (*handler_)(int);
};

TEST(OddCaptures, AFullDiskIsSaidAndTheJobGoesOnWhenThereIsRoom) {
  const RoomCapture capture(6);
  ReconstructOptions options = capture.Options(20);
  options.checkpoint_every = 10;
  const ReconstructInput full = capture.Input("full"), whole = capture.Input("whole");
  {
    const FileSizeLimit limit(100'000);  // the cameras fit, a checkpoint does not
    const absl::Status status = Train(full, options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    EXPECT_EQ(Reason(status), "DISK_FULL");
    EXPECT_THAT(std::string(status.message()), HasSubstr("free some space"));
  }
  EXPECT_FALSE(std::filesystem::is_empty(full.work_dir)) << "the cameras";
  for (const auto& entry : std::filesystem::directory_iterator(full.work_dir)) {
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr("tmp"))) << "half a file was left";
  }
  ASSERT_TRUE(Train(full, options).ok());
  ASSERT_TRUE(Train(whole, options).ok());
  const auto a = ReadFile(full.work_dir + "/scene.litags", "", 1 << 28);
  const auto b = ReadFile(whole.work_dir + "/scene.litags", "", 1 << 28);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_TRUE(*a == *b);
}

}  // namespace
}  // namespace litags
