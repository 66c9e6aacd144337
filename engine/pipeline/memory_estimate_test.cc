#include "engine/pipeline/memory_estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/sandbox.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/capture_test_util.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

constexpr int64_t kGiB = int64_t{1} << 30;

std::vector<ScreenedPhoto> PhotosOf(int count, int width, int height) {
  ScreenedPhoto photo;
  photo.width = width;
  photo.height = height;
  return std::vector<ScreenedPhoto>(count, photo);
}

TEST(MemoryEstimate, GrowsWithWhatTakesMemory) {
  const ReconstructOptions options;
  const MemoryEstimate few = EstimateMemory(PhotosOf(10, 1600, 1200), options, 2, {});
  const MemoryEstimate many = EstimateMemory(PhotosOf(100, 1600, 1200), options, 2, {});
  EXPECT_NEAR(double(many.photos) / few.photos, 10, 1e-6);
  EXPECT_EQ(many.work, few.work);
  // A photo of 12 megapixels is decoded whole, and kept at 1600 px.
  const MemoryEstimate large = EstimateMemory(PhotosOf(10, 4032, 3024), options, 2, {});
  EXPECT_EQ(large.photos, few.photos);
  EXPECT_GT(large.reading, few.reading);
  ReconstructOptions dense = options;
  dense.max_gaussians *= 10;
  EXPECT_EQ(EstimateMemory(PhotosOf(10, 1600, 1200), dense, 2, {}).gaussians, 10 * few.gaussians);
}

// A pixel of a photo and its target takes 14 bytes.
TEST(MemoryEstimate, CountsMasksAndDepthOfANetwork) {
  const ReconstructInput input;
  ReconstructOptions options;
  const auto photos = PhotosOf(10, 1600, 1200);
  const auto bytes = [&](bool masks) { return MapsOf(photos, input, options, masks).bytes; };
  EXPECT_EQ(bytes(/*masks=*/false), 0);
  EXPECT_EQ(bytes(/*masks=*/true), 1);
  options.depth_source = DepthOrigin::kNetwork;
  options.recipe = Litags();
  options.recipe->coarse_levels = 2;
  const auto depth_bytes = [&](bool masks) {
    PhotoMaps maps = MapsOf(photos, input, options, masks);
    const int64_t with = EstimateMemory(photos, options, 1, maps).photos;
    maps.depth.clear();
    return with - EstimateMemory(photos, options, 1, maps).photos;
  };
  const int64_t pixels = 10 * (2 * 384 * 384 + 400 * 300);  // of 1600, 800 and 400 px
  EXPECT_EQ(depth_bytes(false), 4 * pixels);
  EXPECT_EQ(depth_bytes(true), 8 * pixels) << "masked pixels get a confidence";
  options = {};
  const MemoryEstimate bare = EstimateMemory(photos, options, 2, {});
  EXPECT_NEAR(
      double(EstimateMemory(photos, options, 2, {.bytes = 8, .depth = {}}).photos) / bare.photos,
      22 / 14.0, 1e-6);
  // Whether lenses leave rims to mask is not known before the cameras: a byte a pixel.
  EXPECT_NEAR(double(bare.rims) / bare.photos, 1 / 14.0, 1e-6);
  EXPECT_EQ(bare.Most() - bare.Least(), bare.rims + bare.gaussians + MemoryEstimate::kPrograms);
  EXPECT_TRUE(CheckMemory(photos, options, {}, bare.Least()).ok());
  EXPECT_EQ(Reason(CheckMemory(photos, options, {.bytes = 8, .depth = {}}, bare.Least())),
            "MEMORY_EXCEEDED");
}

// They are kept at their own size, and again for the smaller photos of the first iterations.
TEST(MemoryEstimate, CountsGivenDepthMapsAsLargeAsTheyAre) {
  const TempDir dir;
  ASSERT_TRUE(WritePfm(dir / "small.pfm", Planes(1, 300, 400)).ok());
  ASSERT_TRUE(WritePfm(dir / "large.pfm", Planes(1, 2400, 3200)).ok());
  std::vector<ScreenedPhoto> photos = PhotosOf(3, 1600, 1200);
  photos[0].name = "small.jpg";
  photos[1].name = "large.jpg";
  photos[2].name = "none.jpg";
  ReconstructInput input;
  input.depth_dir = dir.path();
  ReconstructOptions options;
  options.recipe = Litags();
  options.recipe->coarse_levels = 2;
  const auto depth_bytes = [&](const ScreenedPhoto& photo) {
    const std::vector<ScreenedPhoto> one = {photo};
    return EstimateMemory(one, options, 1, MapsOf(one, input, options, false)).photos -
           EstimateMemory(one, options, 1, {}).photos;
  };
  EXPECT_EQ(depth_bytes(photos[0]), 8 * 3 * 400 * 300) << "levels of 1600, 800 and 400 px";
  EXPECT_EQ(depth_bytes(photos[1]), 8 * (1600 * 1200 + 800 * 600 + 400 * 300)) << "averaged down";
  EXPECT_EQ(depth_bytes(photos[2]), 0);
  EXPECT_EQ(MapsOf(photos, input, options, true).bytes, 1);
  options.depth_source = DepthOrigin::kNone;
  EXPECT_EQ(depth_bytes(photos[0]), 0);
  options.depth_source = DepthOrigin::kStereo;
  EXPECT_EQ(depth_bytes(photos[0]), 8 * 3 * 320 * 240) << "of its own, for each size of the photo";
  options = {};
  options.method = Method::k3dgs;
  EXPECT_EQ(depth_bytes(photos[0]), 0);
}

TEST(MemoryEstimate, CountsMapsOfStereoOfAsManyPhotosAsGetOne) {
  std::vector<ScreenedPhoto> photos = PhotosOf(40, 1600, 1200);
  for (size_t i = 0; i < photos.size(); ++i) photos[i].name = std::to_string(i);
  const auto count = [&](DepthOrigin source) {
    ReconstructOptions options;
    options.depth_source = source;
    return MapsOf(photos, ReconstructInput(), options, false).depth.size();
  };
  EXPECT_EQ(count(DepthOrigin::kAuto), static_cast<size_t>(Litags().stereo_photos));
  EXPECT_EQ(count(DepthOrigin::kStereo), photos.size());
}

TEST(MemoryEstimate, CountsStereoOfSeveralViews) {
  ReconstructOptions options;
  options.recipe = Litags();
  options.recipe->tone.rule = Tone::kNone;  // targets of 20 photos at once take as much
  const auto photos = PhotosOf(20, 640, 480);
  EXPECT_EQ(EstimateMemory(photos, options, 8, {}).work, 480000000);
  EXPECT_EQ(EstimateMemory(photos, options, 64, {}).work, 480000000) << "eight at once at most";
  options.recipe->dense_start = false;
  const auto work = [&](DepthOrigin source) {
    options.depth_source = source;
    const PhotoMaps maps = MapsOf(photos, ReconstructInput(), options, /*masks=*/false);
    return EstimateMemory(photos, options, 8, maps).work;
  };
  EXPECT_LT(work(DepthOrigin::kNone), 480000000);
  EXPECT_EQ(work(DepthOrigin::kStereo), 480000000);
  EXPECT_EQ(work(DepthOrigin::kAuto), 480000000) << "without maps it is stereo";
  options.recipe = LitagsPaper();
  EXPECT_EQ(work(DepthOrigin::kAuto), work(DepthOrigin::kStereo));
  EXPECT_GT(work(DepthOrigin::kAuto), work(DepthOrigin::kNone));
}

TEST(MemoryEstimate, CountsTheTargetsThatThreadsMakeAtOnce) {
  ReconstructOptions options;
  options.max_image_side = 0;
  const auto photos = PhotosOf(8, 1620, 2880);
  const MemoryEstimate estimate = EstimateMemory(photos, options, 8, {});
  EXPECT_GE(estimate.Most(),
            (12 + 72) * int64_t{8} * 1620 * 2880 + estimate.gaussians + MemoryEstimate::kPrograms);
  options.recipe = Litags();
  options.recipe->tone.rule = Tone::kNone;
  EXPECT_LT(EstimateMemory(photos, options, 8, {}).work, estimate.work);
}

TEST(MemoryEstimate, CountsTheDenoiser) {
  const auto photos = PhotosOf(20, 1600, 1200);
  ReconstructOptions options;
  const auto added = [&] {
    options.recipe->use_pdm = false;
    const int64_t without = EstimateMemory(photos, options, 1, {}).work;
    options.recipe->use_pdm = true;
    return EstimateMemory(photos, options, 1, {}).work - without;
  };
  options.recipe = LitagsPaper();
  options.recipe->use_depth = false;
  EXPECT_EQ(added(), int64_t{656} * 1600 * 1200) << "of whole photos, 3 stages of 16 channels";
  options.recipe->crop_pixels = 200'000;
  EXPECT_EQ(added(), int64_t{656} * 200'000);
  options.recipe->lita = false;
  EXPECT_EQ(added(), 0);
}

TEST(MemoryEstimate, WhatCannotFitIsRefusedWithWhatWould) {
  const std::vector<ScreenedPhoto> photos = PhotosOf(1000, 4032, 3024);
  ReconstructOptions options;
  options.threads = 2;
  const absl::Status status = CheckMemory(photos, options, {}, 8 * kGiB);
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(status), "MEMORY_EXCEEDED");
  // The largest side in steps of 100 px that fits.
  const std::string message(status.message());
  const std::string advice = "max_image_side ";
  const size_t at = message.find(advice);
  ASSERT_NE(at, message.npos) << message;
  options.max_image_side = std::atoi(message.c_str() + at + advice.size());
  EXPECT_LE(EstimateMemory(photos, options, 2, {}).Most(), 8 * kGiB) << message;
  options.max_image_side += 100;
  EXPECT_GT(EstimateMemory(photos, options, 2, {}).Most(), 8 * kGiB) << message;
  EXPECT_THAT(std::string(CheckMemory(photos, options, {}, kGiB / 2).message()),
              HasSubstr("leave photos out"));
  EXPECT_TRUE(CheckMemory(photos, ReconstructOptions(), {}, 0).ok())
      << "nothing is known of memory";
}

// While photos are read none has a target yet, and the colours of shadow are measured on eight.
TEST(MemoryEstimate, LargePhotosOnManyThreads) {
  const std::vector<ScreenedPhoto> photos = PhotosOf(40, 8064, 6048);
  ReconstructOptions options;
  options.threads = 16;
  EXPECT_LT(EstimateMemory(photos, options, 16, {}).Least(), 20 * kGiB);
  EXPECT_EQ(EstimateMemory(photos, options, 16, {}).Least(),
            EstimateMemory(photos, options, 8, {}).Least());
  const std::string message(CheckMemory(photos, options, {}, 8 * kGiB).message());
  EXPECT_THAT(message, HasSubstr("with 16 threads, and there are 8.0 GiB: threads 3 takes"));
  options.threads = 3;
  EXPECT_TRUE(CheckMemory(photos, options, {}, 8 * kGiB).ok());
  options.method = Method::k3dgs;
  EXPECT_LT(EstimateMemory(photos, options, 16, {}).Least(), 14 * kGiB);
  // Where no number of threads is small enough, both must be smaller.
  options = {};
  options.threads = 16;
  EXPECT_THAT(std::string(CheckMemory(PhotosOf(1000, 8064, 6048), options, {}, 4 * kGiB).message()),
              testing::ContainsRegex("max_image_side [0-9]+ with threads 1 takes"));
}

TEST(MemoryEstimate, IsSaidToPeople) {
  const std::vector<ScreenedPhoto> photos = PhotosOf(30, 1600, 1200);
  ReconstructOptions options;
  options.threads = 2;
  EXPECT_THAT(DescribeMemory(photos, options, {}, 8 * kGiB),
              testing::MatchesRegex(
                  "a run would take 1.[0-9] GiB to 1.[0-9] GiB of memory; there are 8.0 GiB"));
  EXPECT_THAT(DescribeMemory(photos, options, {}, 0), testing::EndsWith("of memory"));
  EXPECT_EQ(DescribeMemory(photos, options, {}, kGiB / 2),
            CheckMemory(photos, options, {}, kGiB / 2).message());
}

TEST(MemoryEstimate, ARunIsRefusedBeforeCamerasAreFound) {
  const RoomCapture capture(6);
  ReconstructInput input = capture.Input("work");
  input.memory_bytes = 1000;
  EXPECT_EQ(Reason(Train(input, capture.Options(10)).status()), "MEMORY_EXCEEDED");
  input.cameras_path.clear();
  EXPECT_EQ(Reason(Train(input, capture.Options(10)).status()), "MEMORY_EXCEEDED");
}

TEST(MemoryEstimate, PhotosWithoutAGivenCameraTakeNone) {
  RoomCapture capture(20);
  const ReconstructOptions options = capture.Options(10);
  constexpr size_t kPlaced = 6;
  capture.model.views.resize(kPlaced);
  capture.model.distortions.resize(kPlaced);
  for (SparsePoint& point : capture.model.points) {
    std::erase_if(point.track, [](const TrackElement& e) { return e.view >= int{kPlaced}; });
  }
  std::erase_if(capture.model.points, [](const SparsePoint& p) { return p.track.empty(); });
  ReconstructInput input = capture.Input("work");
  const auto least = [&](int count) {
    std::vector<ScreenedPhoto> photos = PhotosOf(count, RoomCapture::kWidth, RoomCapture::kHeight);
    for (int i = 0; i < count; ++i) photos[i].name = RoomCapture::Name(i);
    return EstimateMemory(photos, options, 1, MapsOf(photos, input, options, false)).Least();
  };
  input.memory_bytes = least(20) - 1;
  ASSERT_GT(input.memory_bytes, least(kPlaced));
  const auto report = Train(input, options);
  EXPECT_TRUE(report.ok()) << report.status();
}

// Peak of a process that trains on photos of this size, bytes.
int64_t PeakOfTraining(const ReconstructInput& input, const ReconstructOptions& options) {
  const pid_t child = fork();
  if (child == 0) _exit(Train(input, options).ok() ? 0 : 1);
  int status = 0;
  rusage usage = {};
  EXPECT_EQ(wait4(child, &status, 0, &usage), child);
  EXPECT_EQ(status, 0);
  return int64_t{usage.ru_maxrss} * 1024;
}

// What photos add to the peak, from few of them to many, is what the estimate says they add.
TEST(MemoryEstimate, PhotosTakeWhatARunMeasures) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "sanitizers take memory of their own";
  constexpr int kScale = 10;  // 640x480
  int64_t peak[2], estimate[2];
  const int views[2] = {4, 24};
  for (int k = 0; k < 2; ++k) {
    RoomCapture capture(views[k]);
    for (int i = 0; i < views[k]; ++i) {
      capture.SetPhoto(i, ResizeArea(capture.Photo(i, Light::kLow), kScale * RoomCapture::kWidth,
                                     kScale * RoomCapture::kHeight));
      Camera& camera = capture.model.views[i].camera;
      camera = camera.Scaled(kScale * RoomCapture::kWidth, kScale * RoomCapture::kHeight);
    }
    ReconstructOptions options = capture.Options(3);
    options.recipe = Litags();
    options.recipe->dense_start = options.recipe->use_depth = false;
    peak[k] = PeakOfTraining(capture.Input("work"), options);
    estimate[k] = EstimateMemory(PhotosOf(views[k], 640, 480), options, options.threads, {}).photos;
  }
  const double ratio = double(peak[1] - peak[0]) / (estimate[1] - estimate[0]);
  EXPECT_GT(ratio, 0.7);
  EXPECT_LT(ratio, 1.3);
}

}  // namespace
}  // namespace litags
