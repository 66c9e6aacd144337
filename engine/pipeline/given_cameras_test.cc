#include "engine/pipeline/given_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/sfm/fake_colmap.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kWidth = 128, kHeight = 96, kDark = 12;

// Photos that EXIF turns, with cameras of what is stored: COLMAP's.
class StoredCameras : public ::testing::Test {
 protected:
  StoredCameras() {
    input_.images_dir = colmap_.MakePhotos(6, kWidth, kHeight, kDark);
    input_.cameras_path = colmap_.dir() + "/sparse";
    fs::create_directory(input_.cameras_path);
    known_ = CopiesModel("", kWidth, kHeight, {0, 1, 2, 3, 4, 5}, 5);
    for (int i = 0; i < 6; ++i) known_.views[i].name = absl::StrCat("p", i, ".png");
  }

  absl::StatusOr<SparseModel> Read() {
    return ReadGivenCameras(input_, ListPhotos(input_.images_dir, "images").value(), &notes_);
  }

  // Where a camera sees the test's point.
  static constexpr std::array<double, 3> kPoint = {0.3, -0.2, 5};
  static std::pair<double, double> Pixel(const Camera& c, const Distortion& d) {
    const auto p = c.CamFromWorld(kPoint);
    const double x = p[0] / p[2], y = p[1] / p[2], r2 = x * x + y * y;
    const double dx = x * r2 * d.k1 + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x);
    const double dy = y * r2 * d.k1 + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
    return {c.fx * (x + dx) + c.cx, c.fy * (y + dy) + c.cy};
  }

  void Tag(int i, int orientation) const {
    const std::string path = absl::StrCat(input_.images_dir, "/p", i, ".png");
    const std::string jpeg = EncodeJpeg(TestImage(kWidth, kHeight)).value();
    ASSERT_TRUE(WriteFileAtomically(path, WithJpegExif(jpeg, ExifBlock(orientation, true))).ok());
  }

  const FakeColmap colmap_;
  ReconstructInput input_;
  SparseModel known_;
  std::vector<std::string> notes_;
};

TEST_F(StoredCameras, AreTurnedUprightWithTheirPhotos) {
  Tag(1, 6);
  Tag(4, 8);
  for (const int i : {1, 4}) {
    Camera& camera = known_.views[i].camera;
    camera.fy = 60;
    camera.cx += 3;
    camera.cy -= 2;
    known_.distortions[i] = {.k1 = 0.1, .p1 = 0.02, .p2 = -0.01};
  }
  for (SparsePoint& point : known_.points) {
    for (TrackElement& e : point.track) {
      std::tie(e.x, e.y) = Pixel(known_.views[e.view].camera, known_.distortions[e.view]);
    }
  }
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  for (const int i : {1, 4}) {
    const Camera& camera = cameras->views[i].camera;
    EXPECT_EQ(camera.width, kHeight);
    EXPECT_EQ(camera.height, kWidth);
    EXPECT_TRUE(camera.Validate("").ok());
    // EXIF 6: to be turned clockwise; 8: the other way.
    const auto [x, y] = Pixel(known_.views[i].camera, known_.distortions[i]);
    const auto [turned_x, turned_y] = Pixel(camera, cameras->distortions[i]);
    EXPECT_NEAR(turned_x, i == 1 ? kHeight - y : y, 1e-9);
    EXPECT_NEAR(turned_y, i == 1 ? x : kWidth - x, 1e-9);
  }
  EXPECT_GT(cameras->points[0].track_length(), 0);
  for (const TrackElement& e : cameras->points[0].track) {
    const auto [x, y] = Pixel(cameras->views[e.view].camera, cameras->distortions[e.view]);
    EXPECT_NEAR(e.x, x, 1e-9) << e.view;
    EXPECT_NEAR(e.y, y, 1e-9) << e.view;
  }
  EXPECT_THAT(notes_, Contains(HasSubstr("2 of 6 cameras are of photos as stored")));
}

TEST_F(StoredCameras, OfUprightPhotosAreTakenAsTheyAre) {
  Tag(1, 6);
  Camera& camera = known_.views[1].camera;
  std::swap(camera.width, camera.height);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  EXPECT_EQ(cameras->views[1].camera.Viewmat(), known_.views[1].camera.Viewmat());
  EXPECT_THAT(notes_, IsEmpty());
}

// As those that a run found itself.
TEST_F(StoredCameras, ThatAreSaidToBeUprightAreTakenAsTheyAre) {
  Tag(1, 3);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  input_.cameras_are_upright = true;
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  EXPECT_EQ(cameras->views[1].camera.Viewmat(), known_.views[1].camera.Viewmat());
}

TEST_F(StoredCameras, AreRefusedWhereTheSizeDoesNotTellThem) {
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  for (const int orientation : {2, 3, 4, 5, 7}) {
    Tag(3, orientation);
    const absl::Status status = Read().status();
    EXPECT_EQ(Reason(status), "ORIENTATION_AMBIGUOUS") << orientation;
    EXPECT_THAT(std::string(status.message()), HasSubstr("p3.png: its EXIF orientation"));
    EXPECT_THAT(std::string(status.message()), HasSubstr("mogrify -auto-orient"));
  }
}

// Files without sizes: nothing but Bundler's points tells what their cameras are of.
TEST_F(StoredCameras, WithoutASizeAreRefusedUnlessTheirPointsTell) {
  Tag(0, 6);
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteFileAtomically(input_.cameras_path,
                                  R"({"fl_x": 100, "frames": [{"file_path": "p0.png",
      "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]})")
                  .ok());
  EXPECT_EQ(Reason(Read().status()), "ORIENTATION_AMBIGUOUS");
  Tag(0, 1);
  EXPECT_TRUE(Read().ok());

  Tag(0, 6);  // upright, it is 96 x 128
  input_.cameras_path = colmap_.dir() + "/bundle.out";
  const auto read_seen_at = [&](const std::string& place) {
    EXPECT_TRUE(WriteFileAtomically(input_.cameras_path,
                                    "# Bundle file v0.3\n1 1\n100 0 0\n1 0 0\n0 -1 0\n0 0 -1\n"
                                    "0 0 0\n0 0 0\n0 0 0\n1 0 7 " +
                                        place + "\np0.png\n")
                    .ok());
    return Read();
  };
  EXPECT_EQ(Reason(read_seen_at("40 40").status()), "ORIENTATION_AMBIGUOUS");
  EXPECT_THAT(notes_, IsEmpty());
  const auto upright = read_seen_at("40 60");
  ASSERT_TRUE(upright.ok()) << upright.status();
  EXPECT_EQ(upright->views[0].camera.R[0], 1);
  EXPECT_THAT(notes_, IsEmpty());
  const auto stored = read_seen_at("60 40");
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->views[0].camera.width, kHeight);
  EXPECT_EQ(stored->views[0].camera.R[0], 0);
  EXPECT_THAT(notes_, Contains(HasSubstr("1 of 1 cameras are of photos as stored")));
}

// In another unit, or of photos of another size.
TEST_F(StoredCameras, WhoseLensIsThatOfNoPictureOfTheirSizeAreRefused) {
  Camera& camera = known_.views[2].camera;
  camera.fx = camera.fy = 0.8;
  camera.cx = camera.cy = 0.5;
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const absl::Status status = Read().status();
  EXPECT_EQ(Reason(status), "BAD_FOCAL_LENGTH");
  EXPECT_THAT(std::string(status.message()), HasSubstr("cameras[p2.png]: the focal lengths, 0.8"));

  input_.cameras_path = colmap_.dir() + "/transforms.json";
  const auto read_with = [&](const std::string& middle) {
    EXPECT_TRUE(WriteFileAtomically(input_.cameras_path, "{\"fl_x\": 100, " + middle +
                                                             R"(, "frames": [{"file_path": "p0.png",
        "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]})")
                    .ok());
    return Read().status();
  };
  EXPECT_EQ(Reason(read_with(R"("cx": 640, "cy": 48)")), "BAD_PRINCIPAL_POINT");
  EXPECT_TRUE(read_with(R"("cx": 128, "cy": 0)").ok());
  EXPECT_TRUE(read_with(R"("w": 1280, "h": 960, "cx": 640, "cy": 480)").ok());
}

// Photos of several folders have these in their names, since all lie in one.
TEST_F(StoredCameras, OfPhotosInSeveralFoldersAreFoundByTheFolders) {
  for (int i = 0; i < 6; ++i) {
    const std::string name = absl::StrCat("cam", i / 3, "_", i % 3, ".png");
    fs::rename(absl::StrCat(input_.images_dir, "/p", i, ".png"), input_.images_dir + "/" + name);
    known_.views[i].name = absl::StrCat("rig/cam", i / 3, "/", i % 3, ".png");
  }
  known_.views[5].name = "rig/cam1/other.png";
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  std::vector<std::string> names;
  for (const View& view : cameras->views) names.push_back(view.name);
  EXPECT_THAT(names,
              ElementsAre("cam0_0.png", "cam0_1.png", "cam0_2.png", "cam1_0.png", "cam1_1.png"));
  EXPECT_EQ(cameras->views[4].camera.t, known_.views[4].camera.t);
}

TEST_F(StoredCameras, OfSeveralFoldersThatMayBeOfOnePhotoAreRefused) {
  known_.views[0].name = "cam0/p0.png";
  known_.views[1].name = "cam1/p0.png";
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const absl::Status status = Read().status();
  EXPECT_EQ(Reason(status), "DUPLICATE_CAMERA");
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("photo p0.png may have the camera of cam0/p0.png or of cam1/p0.png"),
                    HasSubstr("as cam1_p0.png")));
}

// The camera of p0.dng, which is not there, stands before that of p0.png.
TEST_F(StoredCameras, WithoutTheirPhotoTakeNoOthers) {
  known_.views[1].name = "p0.dng";
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_EQ(cameras->views.size(), 5u);
  EXPECT_EQ(cameras->views[0].name, "p0.png");
  EXPECT_EQ(cameras->views[0].camera.t, known_.views[0].camera.t);
}

TEST_F(StoredCameras, OfOnePhotoByItsStemAreBothNamed) {
  known_.views[0].name = "p0.dng";
  known_.views[1].name = "p0.tif";
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const absl::Status status = Read().status();
  EXPECT_EQ(Reason(status), "DUPLICATE_CAMERA");
  EXPECT_THAT(std::string(status.message()), HasSubstr("of p0.dng or of p0.tif"));
}

// As of photos that were shrunk since, or undistorted.
TEST_F(StoredCameras, OfPhotosOfAnotherSizeAreScaledWithANote) {
  for (View& view : known_.views) view.camera = view.camera.Scaled(2 * kWidth, 2 * kHeight);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  EXPECT_EQ(cameras->views[0].camera.width, kWidth);
  ASSERT_EQ(cameras->points.size(), known_.points.size());
  ASSERT_FALSE(cameras->points.empty());
  for (size_t i = 0; i < cameras->points[0].track.size(); ++i) {
    EXPECT_EQ(cameras->points[0].track[i].x, known_.points[0].track[i].x / 2);
    EXPECT_EQ(cameras->points[0].track[i].y, known_.points[0].track[i].y / 2);
  }
  EXPECT_THAT(notes_, Contains(HasSubstr("256x192 px for p0.png of 128x96, and were scaled")));
}

// As of a mosaic, which could not be a photo itself.
TEST_F(StoredCameras, OfPhotosOfAnySizeAreScaled) {
  const Camera before = known_.views[0].camera;
  for (View& view : known_.views) view.camera = view.camera.Scaled(400 * kWidth, 400 * kHeight);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known_).ok());
  const auto cameras = Read();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  EXPECT_EQ(cameras->views[0].camera.width, kWidth);
  EXPECT_NEAR(cameras->views[0].camera.fx, before.fx, 1e-9);
}

}  // namespace
}  // namespace litags
