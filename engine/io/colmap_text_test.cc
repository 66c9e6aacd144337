#include "engine/io/colmap_text.h"

#include <string>

#include "absl/status/status.h"
#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// As COLMAP 3.8 writes it, with an image that sees nothing and a name with a space.
constexpr char kCameras[] =
    "# Camera list with one line of data per camera:\n"
    "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
    "# Number of cameras: 2\n"
    "1 PINHOLE 64 48 70 71.5 32 24\n"
    "7 OPENCV 40 30 50 51 20 15 0.1 -0.2 0.003 0.004\n";
constexpr char kImages[] =
    "# Image list with two lines of data per image:\r\n"
    "2 1 0 0 0 0.5 -1 2e0 1 night/b.jpg\r\n"
    "\r\n"
    "5 0 1 0 0 0 0 1 7 a b.jpg\n"
    "10.5 11 3 12 13.25 -1\n";
constexpr char kPoints[] =
    "# 3D point list\n"
    "3 0.25 -1 4 10 20 30 0.75 5 0\n"
    "4 1 1 1 0 0 0 -1\n";

absl::StatusOr<SparseModel> Parse(const std::string& cameras, const std::string& images,
                                  const std::string& points) {
  TempDir dir;
  EXPECT_TRUE(WriteFileAtomically(dir / "cameras.txt", cameras).ok());
  EXPECT_TRUE(WriteFileAtomically(dir / "images.txt", images).ok());
  EXPECT_TRUE(WriteFileAtomically(dir / "points3D.txt", points).ok());
  return ReadColmapModel(dir.path(), "model");
}

TEST(ColmapText, IsReadAsColmapWritesIt) {
  const auto model = Parse(kCameras, kImages, kPoints);
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 2u);
  EXPECT_EQ(model->views[0].name, "a b.jpg");
  EXPECT_EQ(model->views[0].camera.width, 40);
  EXPECT_EQ(model->views[0].camera.R[4], -1);  // half a turn around x
  EXPECT_EQ(model->distortions[0].k2, -0.2);
  EXPECT_EQ(model->views[1].name, "b.jpg");
  EXPECT_EQ(model->views[1].camera.fy, 71.5);
  EXPECT_EQ(model->views[1].camera.t[2], 2);
  ASSERT_EQ(model->points.size(), 2u);
  EXPECT_EQ(model->points[0].xyz[0], 0.25);
  EXPECT_EQ(model->points[0].rgb[2], 30);
  ASSERT_EQ(model->points[0].track_length(), 1);
  EXPECT_EQ(model->points[0].track[0].view, 0);
  EXPECT_EQ(model->points[0].track[0].x, 10.5);
  EXPECT_EQ(model->points[1].track_length(), 0);
}

TEST(ColmapText, TheBinaryFormIsTakenWhereBothAreThere) {
  TempDir dir;
  const auto model = Parse(kCameras, kImages, kPoints);
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_TRUE(WriteColmapModel(dir.path(), *model).ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "cameras.txt", "broken").ok());
  EXPECT_TRUE(ReadColmapModel(dir.path(), "model").ok());
}

TEST(ColmapText, WhatIsWrongIsSaidWithFileAndLine) {
  struct Case {
    std::string cameras, images, points;
    const char* field;
    const char* reason;
    const char* words;
  };
  const std::string c = kCameras, i = kImages, p = kPoints;
  for (const Case& x : std::vector<Case>{
           {"1 FISHEYE 4 3 1 1 1 1\n", i, p, "model/cameras.txt", "UNSUPPORTED_CAMERA_MODEL",
            "line 1"},
           {"1 PINHOLE 64 48 70 71 32\n", i, p, "model/cameras.txt", "MODEL_CORRUPT", "line 1"},
           {"1 PINHOLE 64 48 70 71 32 24 9\n", i, p, "model/cameras.txt", "MODEL_CORRUPT",
            "line 1"},
           {"1 PINHOLE -64 48 70 71 32 24\n", i, p, "model/cameras.txt", "MODEL_CORRUPT", "line 1"},
           {c, "\n2 1 0 0 0 0 0 0 1\n", p, "model/images.txt", "MODEL_CORRUPT", "line 2"},
           {c, "2 1 0 0 0 0 0 zero 1 a.jpg\n", p, "model/images.txt", "MODEL_CORRUPT", "line 1"},
           {c, "2 1 0 0 0 0 0 0 1 a.jpg\n1 2\n", p, "model/images.txt", "MODEL_CORRUPT", "line 2"},
           {c, i, "3 0 0 0 10 20 300 1 5 0\n", "model/points3D.txt", "MODEL_CORRUPT", "line 1"},
           {c, i, "3 0 0 0 10 20 30 1 5\n", "model/points3D.txt", "MODEL_CORRUPT", "line 1"},
           // What the binary reader checks, by the names of the text files.
           {c, "2 1 0 0 0 0 0 0 9 a.jpg\n", p, "model/images.txt", "MODEL_CORRUPT", "camera 9"},
           {c, i, "3 nan 0 0 10 20 30 1\n", "model/points3D.txt", "NOT_FINITE", "NaN"},
           {c, "# none\n", p, "model/images.txt", "NO_CAMERAS", "no image"}}) {
    const absl::Status status = Parse(x.cameras, x.images, x.points).status();
    const auto detail = GetErrorDetail(status);
    ASSERT_TRUE(detail.has_value()) << status << x.words;
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(detail->field, x.field) << status;
    EXPECT_EQ(detail->reason, x.reason) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(x.words));
  }
}

}  // namespace
}  // namespace litags
