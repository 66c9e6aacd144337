// The real COLMAP twice, with one thread and with two: the same bits.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/sample/capture.h"
#include "engine/sfm/colmap.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/colmap_keypoints.h"
#include "engine/sfm/sfm.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

void ExpectSameBits(const SparseModel& a, const SparseModel& b) {
  ASSERT_EQ(a.views.size(), b.views.size());
  for (size_t i = 0; i < a.views.size(); ++i) {
    const Camera &ca = a.views[i].camera, &cb = b.views[i].camera;
    EXPECT_EQ(a.views[i].name, b.views[i].name);
    EXPECT_EQ(ca.R, cb.R) << i;
    EXPECT_EQ(ca.t, cb.t) << i;
    EXPECT_EQ(ca.fx, cb.fx) << i;
    EXPECT_EQ(a.distortions[i].k1, b.distortions[i].k1) << i;
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t i = 0; i < a.points.size(); ++i) {
    const SparsePoint &pa = a.points[i], &pb = b.points[i];
    ASSERT_EQ(pa.xyz, pb.xyz) << i;
    ASSERT_EQ(pa.rgb, pb.rgb) << i;
    ASSERT_EQ(pa.error, pb.error) << i;
    ASSERT_EQ(pa.track.size(), pb.track.size()) << i;
    for (size_t k = 0; k < pa.track.size(); ++k) {
      ASSERT_EQ(pa.track[k].view, pb.track[k].view) << i;
      ASSERT_EQ(pa.track[k].x, pb.track[k].x) << i;
      ASSERT_EQ(pa.track[k].y, pb.track[k].y) << i;
    }
  }
}

class Repeat : public ::testing::Test {
 protected:
  void WriteCapture() {
    capture_.views = 10;
    capture_.antialias = 2;
    const auto written = sample::WriteCapture(capture_, dir_);
    ASSERT_TRUE(written.ok()) << written.status();
  }

  SfmOptions Options(int threads) const {
    SfmOptions options;
    options.threads = threads;
    options.max_features = 2000;
    return options;
  }

  const TempDir temp_;
  const std::string dir_ = temp_.path();
  sample::CaptureOptions capture_;
  const CancelToken cancel_;
};

TEST_F(Repeat, PhotosGiveTheSameCamerasAndPointsForAnyNumberOfThreads) {
  ASSERT_NO_FATAL_FAILURE(WriteCapture());
  std::vector<SparseModel> models;
  for (const int threads : {1, 2}) {
    const auto result = FindCameras(dir_ + "/low", dir_ + "/work", Options(threads), cancel_);
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_GT(result->model.points.size(), 200u);
    models.push_back(result->model);
  }
  ExpectSameBits(models[0], models[1]);
}

TEST_F(Repeat, KnownCamerasGetTheSamePointsForAnyNumberOfThreads) {
  ASSERT_NO_FATAL_FAILURE(WriteCapture());
  SparseModel known;
  known.views = sample::CaptureViews(capture_);
  known.distortions.resize(known.views.size());
  std::vector<SparseModel> models;
  for (const int threads : {1, 2}) {
    const auto result =
        TriangulatePoints(dir_ + "/low", known, dir_ + "/work", Options(threads), cancel_);
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_GT(result->model.points.size(), 200u);
    models.push_back(result->model);
  }
  ExpectSameBits(models[0], models[1]);
}

// VLFeat does not describe features in the last row of an image. COLMAP 3.8 stores what the memory
// held, unless it held zeros.
TEST_F(Repeat, FeaturesAtTheBorderHaveTheSameDescriptors) {
  constexpr int kPhotos = 4, kWidth = 400, kHeight = 300;
  std::vector<std::vector<std::vector<uint8_t>>> descriptors;
  int at_border = 0;
  for (const int threads : {1, 2}) {
    const std::string rung = dir_ + "/rung" + std::to_string(threads);
    const SfmOptions options = Options(threads);
    Colmap colmap(options, rung, cancel_);
    fs::create_directories(colmap.images_dir() + "/a");
    std::vector<std::string> names;
    std::vector<PhotoFile> photos;
    for (int p = 0; p < kPhotos; ++p) {
      const CounterRng noise(1, static_cast<uint64_t>(p));
      ImageU8 image(kWidth, kHeight);
      // Squares of two pixels, so that there are blobs of every small size.
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const auto code = static_cast<uint8_t>(
              noise.Below(static_cast<uint64_t>((y / 2) * kWidth + x / 2), 256));
          std::fill_n(image.pixel(x, y), 3, code);
        }
      }
      names.push_back("a/" + std::to_string(p) + ".png");
      ASSERT_TRUE(WritePng(colmap.images_dir() + "/" + names.back(), image).ok());
      PhotoFile& photo = photos.emplace_back();
      photo.copy_name = names.back();
      photo.copy_width = kWidth;
      photo.copy_height = kHeight;
    }
    const auto extracted = colmap.ExtractFeatures(photos, [](double) {});
    ASSERT_TRUE(extracted.ok()) << extracted.status();
    ASSERT_TRUE(NumberImages(colmap.database_path(), names).ok());
    const auto images = ReadDatabaseImages(colmap.database_path());
    ASSERT_TRUE(images.ok()) << images.status();
    for (int p = 0; p < kPhotos; ++p) EXPECT_EQ((*images)[p].name, names[p]);
    const auto read = ReadDescriptors(colmap.database_path(), *images);
    ASSERT_TRUE(read.ok()) << read.status();
    descriptors.push_back(*read);
    const auto keypoints = ReadKeypoints(colmap.database_path(), *images);
    ASSERT_TRUE(keypoints.ok()) << keypoints.status();
    for (const auto& of_photo : *keypoints) {
      for (const auto& point : of_photo) at_border += point.y() > kHeight - 1;
    }
  }
  EXPECT_GT(at_border, 0) << "the photos do not show the case";
  EXPECT_TRUE(descriptors[0] == descriptors[1]);
}

}  // namespace
}  // namespace litags
