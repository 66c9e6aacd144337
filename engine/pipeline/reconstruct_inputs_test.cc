// The whole engine on photos, cameras and options that do not fit: what is left out, changed,
// refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Reconstruct, LeavesOutABlackPhoto) {
  const Photographs photos;
  ASSERT_TRUE(WritePng(photos.Photo("photo3.png"), ImageU8(kWidth, kHeight)).ok());
  ReconstructOptions options = SmallOptions();
  options.iterations = 10;
  const auto report = Reconstruct(photos.Input("work"), options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->photos, kPhotos);
  EXPECT_EQ(report->registered, kPhotos - 1);
  EXPECT_THAT(report->dropped, ElementsAre("photo3.png"));
  EXPECT_THAT(report->notes, Contains("photo3.png is left out: it is of one colour, (0, 0, 0)"));
  const auto scene = MakeEngine()->LoadScene(report->scene_path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ((*scene)->views().size(), size_t{kPhotos - 1});
  for (const View& view : (*scene)->views()) EXPECT_NE(view.name, "photo3.png");
}

TEST(Reconstruct, LeavesOutPhotosWithoutACamera) {
  const Photographs photos;
  ASSERT_TRUE(WritePng(photos.Photo("another.png"), TestImage(kWidth, kHeight)).ok());
  ReconstructOptions options = SmallOptions();
  options.iterations = 10;
  const ReconstructInput input = photos.Input("work");
  // The second time from the cameras that were kept.
  for (int run = 0; run < 2; ++run) {
    const auto report = Reconstruct(input, options);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->photos, kPhotos + 1);
    EXPECT_EQ(report->registered, kPhotos);
    EXPECT_THAT(report->dropped, ElementsAre("another.png"));
    EXPECT_THAT(report->notes, Contains(HasSubstr("1 of 9 photos have no camera")));
  }
}

TEST(Reconstruct, TooFewPhotosAreRefused) {
  const Photographs photos;
  for (int i = 2; i < kPhotos; ++i) {
    fs::remove(photos.Photo("photo" + std::to_string(i) + ".png"));
  }
  const absl::Status status = Reconstruct(photos.Input("work"), SmallOptions()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
}

TEST(Reconstruct, BlackPhotosDoNotCount) {
  const Photographs photos;
  for (int i = 2; i < kPhotos; ++i) {
    const std::string name = "photo" + std::to_string(i) + ".png";
    ASSERT_TRUE(WritePng(photos.Photo(name), ImageU8(kWidth, kHeight)).ok());
  }
  const absl::Status status = Reconstruct(photos.Input("work"), SmallOptions()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
}

// photo0.jpg and photo0.tif are no photos here, but have the stem of one.
TEST(Reconstruct, TwoCamerasOfOnePhotoAreRefused) {
  Photographs photos;
  photos.model.views[0].name = "photo0.jpg";
  photos.model.views.push_back({"photo0.tif", photos.model.views[1].camera});
  photos.model.distortions.emplace_back();
  photos.WriteModel();
  const absl::Status status = Reconstruct(photos.Input("work"), SmallOptions()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  EXPECT_EQ(Reason(status), "DUPLICATE_CAMERA");
  EXPECT_THAT(std::string(status.message()), HasSubstr("photo0.png"));
}

TEST(Reconstruct, CamerasOfOtherPhotosAreRefused) {
  Photographs photos;
  for (View& view : photos.model.views) view.name = "other_" + view.name;
  photos.WriteModel();
  const absl::Status status = Reconstruct(photos.Input("work"), SmallOptions()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  EXPECT_EQ(Reason(status), "NO_MATCHING_CAMERAS");
}

TEST(Reconstruct, CamerasOfAnotherShapeAreRefused) {
  const Photographs photos;
  ASSERT_TRUE(WritePng(photos.Photo("photo5.png"), TestImage(kHeight, kWidth)).ok());
  const absl::Status status = Reconstruct(photos.Input("work"), SmallOptions()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  EXPECT_EQ(Reason(status), "CAMERA_SIZE_MISMATCH");
  EXPECT_EQ(GetErrorDetail(status)->field, "images[photo5.png]");
}

// Cameras of photos twice as large are brought to the size of the photos.
TEST(Reconstruct, CamerasOfLargerPhotosAreScaled) {
  Photographs photos;
  ReconstructOptions options = SmallOptions();
  options.iterations = 10;
  const ReconstructInput same = photos.Input("same"), larger = photos.Input("larger");
  ASSERT_TRUE(Reconstruct(same, options).ok());
  for (View& view : photos.model.views) {
    view.camera = view.camera.Scaled(2 * kWidth, 2 * kHeight);
  }
  photos.WriteModel();
  const auto report = Reconstruct(larger, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(SceneBytes(larger) == SceneBytes(same));
}

TEST(Reconstruct, ADamagedPhotoIsNamedAndLeftOut) {
  const Photographs photos;
  const std::string path = photos.Photo("photo4.png");
  const std::string bytes = Bytes(path);
  ASSERT_TRUE(WriteFileAtomically(path, bytes.substr(0, bytes.size() / 2)).ok());
  const auto report = Reconstruct(photos.Input("work"), SmallOptions());
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("photo4.png is left out: images[photo4.png]: ")));
  EXPECT_THAT(report->dropped, ElementsAre("photo4.png"));
}

TEST(Reconstruct, MaxGaussiansLimitsTheSparsePoints) {
  const Photographs photos(kWidth, kHeight, /*points=*/1200);
  ReconstructOptions options = SmallOptions();
  options.max_gaussians = 1000;
  options.iterations = 5;
  const auto report = Reconstruct(photos.Input("work"), options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->sparse_points, 1200);
  EXPECT_EQ(report->gaussians, 1000);
  EXPECT_THAT(report->notes, Contains(HasSubstr("of 1200 sparse points the 1000")));
}

TEST(Reconstruct, MaxImageSideShrinksPhotos) {
  const Photographs photos(/*width=*/128, /*height=*/96);
  ReconstructOptions options = SmallOptions();
  options.max_image_side = 64;
  options.iterations = 5;
  const auto report = Reconstruct(photos.Input("work"), options);
  ASSERT_TRUE(report.ok()) << report.status();
  const auto scene = MakeEngine()->LoadScene(report->scene_path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ((*scene)->views()[0].camera.width, 64);
  EXPECT_EQ((*scene)->views()[0].camera.height, 48);
  EXPECT_THAT(report->notes, Contains(HasSubstr(" photos were shrunk to 64 px")));
}

TEST(Reconstruct, BadOptionsAreRefusedBeforeAnythingIsRead) {
  ReconstructOptions options;
  options.iterations = 0;
  const absl::Status status = Reconstruct(ReconstructInput(), options).status();
  EXPECT_EQ(Reason(status), "BAD_OPTION");
}

}  // namespace
}  // namespace litags
