#include "engine/io/colmap_io.h"

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/byte_reader.h"
#include "engine/io/file_util.h"
#include "engine/io/test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

// Views that share intrinsics and views that do not, distorted or not, in many directions.
SparseModel TestModel() {
  SparseModel model;
  for (int i = 0; i < 6; ++i) {
    View view{absl::StrCat("img", i, ".jpg"), {}};
    Camera& c = view.camera;
    c.width = 64;
    c.height = 48;
    c.fx = i < 3 ? 70 : 75;
    c.fy = c.fx + 1;
    c.cx = 32;
    c.cy = 24.5;
    const double a = 2 * M_PI * i / 6 + 0.1;
    EXPECT_TRUE(
        c.LookAt({3 * std::cos(a), 0.3 * i - 1, 3 * std::sin(a)}, {0, 0, 0}, {0, 1, 0}).ok());
    model.views.push_back(view);
    model.distortions.push_back(i == 5 ? Distortion{0.1, -0.02, 0.003, 0.004} : Distortion{});
  }
  for (int p = 0; p < 20; ++p) {
    SparsePoint point;
    point.xyz = {0.1 * p, -0.05 * p, 0.02 * p * p};
    point.rgb = {static_cast<uint8_t>(p), 100, static_cast<uint8_t>(255 - p)};
    point.error = p == 0 ? -1 : 0.1 * p;
    for (int k = 0; k < 2 + p % 3; ++k) point.track.push_back({(p + k) % 6, p + 0.25, k + 0.5});
    model.points.push_back(point);
  }
  return model;
}

void ExpectSameModel(const SparseModel& a, const SparseModel& b) {
  ASSERT_EQ(a.views.size(), b.views.size());
  for (size_t v = 0; v < a.views.size(); ++v) {
    const Camera &ca = a.views[v].camera, &cb = b.views[v].camera;
    EXPECT_EQ(a.views[v].name, b.views[v].name);
    EXPECT_EQ(ca.width, cb.width);
    EXPECT_EQ(ca.fx, cb.fx);
    EXPECT_EQ(ca.fy, cb.fy);
    EXPECT_EQ(ca.cy, cb.cy);
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(ca.R[i], cb.R[i], 1e-12);  // through a quaternion
    EXPECT_EQ(ca.t, cb.t);
    EXPECT_EQ(a.distortions[v].k1, b.distortions[v].k1);
    EXPECT_EQ(a.distortions[v].p2, b.distortions[v].p2);
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t p = 0; p < a.points.size(); ++p) {
    const SparsePoint &pa = a.points[p], &pb = b.points[p];
    EXPECT_EQ(pa.xyz, pb.xyz);
    EXPECT_EQ(pa.rgb, pb.rgb);
    EXPECT_EQ(pa.error, pb.error);
    ASSERT_EQ(pa.track_length(), pb.track_length());
    for (int k = 0; k < pa.track_length(); ++k) {
      EXPECT_EQ(pa.track[k].view, pb.track[k].view);
      EXPECT_EQ(pa.track[k].x, pb.track[k].x);
      EXPECT_EQ(pa.track[k].y, pb.track[k].y);
    }
  }
}

TEST(ColmapModel, IsReadBackTheSame) {
  TempDir dir;
  const SparseModel model = TestModel();
  ASSERT_TRUE(WriteColmapModel(dir.path(), model).ok());
  const auto back = ReadColmapModel(dir.path(), "cameras");
  ASSERT_TRUE(back.ok()) << back.status();
  ExpectSameModel(model, *back);
}

TEST(ColmapModel, RotationsByHalfATurnSurvive) {
  TempDir dir;
  SparseModel model = TestModel();
  model.points.clear();
  // The quaternion's w is 0 here: the branch that divides by w would fail.
  model.views[0].camera.R = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  model.views[1].camera.R = {-1, 0, 0, 0, 1, 0, 0, 0, -1};
  model.views[2].camera.R = {-1, 0, 0, 0, -1, 0, 0, 0, 1};
  ASSERT_TRUE(WriteColmapModel(dir.path(), model).ok());
  const auto back = ReadColmapModel(dir.path(), "cameras");
  ASSERT_TRUE(back.ok()) << back.status();
  ExpectSameModel(model, *back);
}

// A model of one camera and one image named `name`, without points.
void WriteOneCamera(const TempDir& dir, int32_t model, const std::vector<double>& params,
                    const std::string& name = "low/a.jpg", uint32_t camera_of_image = 7) {
  std::string cameras, images;
  AppendNumber(&cameras, uint64_t{1});
  AppendNumber(&cameras, uint32_t{7});
  AppendNumber(&cameras, model);
  AppendNumber(&cameras, uint64_t{40});
  AppendNumber(&cameras, uint64_t{30});
  for (double p : params) AppendNumber(&cameras, p);
  AppendNumber(&images, uint64_t{1});
  AppendNumber(&images, uint32_t{3});
  for (double v : {1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3}) AppendNumber(&images, v);
  AppendNumber(&images, camera_of_image);
  images.append(name.c_str(), name.size() + 1);
  AppendNumber(&images, uint64_t{0});
  ASSERT_TRUE(WriteFileAtomically(dir / "cameras.bin", cameras).ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "images.bin", images).ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "points3D.bin", std::string(8, '\0')).ok());
}

TEST(ReadColmapModel, KnowsFiveCameraModels) {
  struct Case {
    int32_t model;
    std::vector<double> params;
    double fy, k1, k2, p1, p2;
  };
  for (const Case& c :
       std::vector<Case>{{0, {50, 20, 15}, 50, 0, 0, 0, 0},
                         {1, {50, 51, 20, 15}, 51, 0, 0, 0, 0},
                         {2, {50, 20, 15, .1}, 50, .1, 0, 0, 0},
                         {3, {50, 20, 15, .1, .2}, 50, .1, .2, 0, 0},
                         {4, {50, 51, 20, 15, .1, .2, .3, .4}, 51, .1, .2, .3, .4}}) {
    TempDir dir;
    WriteOneCamera(dir, c.model, c.params);
    const auto model = ReadColmapModel(dir.path(), "cameras");
    ASSERT_TRUE(model.ok()) << model.status();
    EXPECT_EQ(model->views[0].name, "a.jpg");
    const Camera& camera = model->views[0].camera;
    EXPECT_EQ(camera.fx, 50);
    EXPECT_EQ(camera.fy, c.fy);
    EXPECT_EQ(camera.cx, 20);
    EXPECT_EQ(camera.cy, 15);
    EXPECT_EQ(camera.t[2], 0.3);
    const Distortion& d = model->distortions[0];
    EXPECT_EQ(d.k1, c.k1);
    EXPECT_EQ(d.k2, c.k2);
    EXPECT_EQ(d.p1, c.p1);
    EXPECT_EQ(d.p2, c.p2);
  }
}

// Photos that come with them may be smaller ones.
TEST(ParseColmapModel, TakesCamerasOfLargePhotosAndUnusedLensesThatAreNotRead) {
  const std::string cameras =
      "1 PINHOLE 11648 8736 9000 9000 5824 4368\n2 FOV 40 30 50 50 20 15 0.9\n";
  const std::string pose = "7 1 0 0 0 0 0 0 ";
  const auto model = ParseColmapText(cameras, pose + "1 a.jpg\n\n", "", "f");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views[0].camera.width, 11648);
  const absl::Status status = ParseColmapText(cameras, pose + "2 a.jpg\n\n", "", "f").status();
  EXPECT_EQ(Reason(status), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("camera 2 has COLMAP's camera "
                                                                "model FOV"));
}

TEST(ReadColmapModel, RefusesWhatMakesNoSense) {
  const auto reason = [](int32_t model, const std::vector<double>& params,
                         const std::string& name = "a.jpg", uint32_t camera = 7) {
    TempDir dir;
    WriteOneCamera(dir, model, params, name, camera);
    return Reason(ReadColmapModel(dir.path(), "cameras").status());
  };
  EXPECT_EQ(reason(7, {50, 51, 20, 15, 0.9}), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_EQ(reason(10, std::vector<double>(12, 1)), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_EQ(reason(-1, {50, 51, 20, 15}), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_EQ(reason(0, {NAN, 20, 15}), "NOT_FINITE");
  EXPECT_EQ(reason(2, {50, 20, 15, NAN}), "NOT_FINITE");
  EXPECT_EQ(reason(0, {-50, 20, 15}), "BAD_FOCAL_LENGTH");
  EXPECT_EQ(reason(0, {50, 20, 15}, "a.jpg", 8), "MODEL_CORRUPT");
  EXPECT_EQ(reason(0, {50, 20, 15}, "low/.."), "BAD_FILE_NAME");
  TempDir empty;
  const absl::Status missing = ReadColmapModel(empty.path(), "cameras").status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.message()), testing::StartsWith("cameras/cameras.bin: "));
}

// The three files of TestModel().
std::vector<std::string> TestFiles() {
  TempDir dir;
  EXPECT_TRUE(WriteColmapModel(dir.path(), TestModel()).ok());
  std::vector<std::string> files;
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    files.push_back(ReadFile(dir / name, name, 1 << 20).value());
  }
  return files;
}

// Parses `files` with one of them replaced.
absl::StatusOr<SparseModel> ParseWith(std::vector<std::string> files, size_t which,
                                      std::string bytes) {
  files[which] = std::move(bytes);
  return ParseColmapModel(files[0], files[1], files[2], "f");
}

TEST(ParseColmapModel, RefusesHostileCounts) {
  const std::vector<std::string> files = TestFiles();
  for (size_t which = 0; which < 3; ++which) {
    for (uint64_t count : {uint64_t{1} << 62, ~uint64_t{0}, uint64_t{1000000}}) {
      std::string bytes = files[which];
      std::memcpy(bytes.data(), &count, 8);
      EXPECT_EQ(Reason(ParseWith(files, which, bytes).status()), "MODEL_TRUNCATED") << which;
    }
  }
}

TEST(ParseColmapModel, RefusesEveryTruncation) {
  const std::vector<std::string> files = TestFiles();
  for (size_t which = 0; which < 3; ++which) {
    for (size_t n = 0; n < files[which].size(); ++n) {
      const absl::Status status = ParseWith(files, which, files[which].substr(0, n)).status();
      ASSERT_EQ(Reason(status), "MODEL_TRUNCATED") << which << " " << n;
    }
  }
}

// Converters of LiDAR and SLAM maps write images without observations, and image 0, observation 0
// for each point.
TEST(ParseColmapModel, LeavesPlaceholdersOutOfTracks) {
  const auto model = ParseColmapText("1 PINHOLE 40 30 50 50 20 15\n",
                                     "0 1 0 0 0 0 0 0 1 a.jpg\n\n5 1 0 0 0 1 0 0 1 b.jpg\n\n",
                                     "1 0 0 4 9 9 9 0 0 0\n2 1 0 4 9 9 9 0 7 0 5 3\n", "f");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->points.size(), 2u);
  for (const SparsePoint& point : model->points) EXPECT_EQ(point.track_length(), 0);
}

TEST(ParseColmapModel, SurvivesCorruption) {
  const std::vector<std::string> files = TestFiles();
  for (size_t which = 0; which < 3; ++which) {
    int refused = 0;
    ForEachCorruption(files[which], 3000, [&](const std::string& broken) {
      const absl::StatusOr<SparseModel> model = ParseWith(files, which, broken);
      refused += !model.ok();
      if (!model.ok()) return;
      for (const SparsePoint& point : model->points) {
        for (const TrackElement& e : point.track) {
          ASSERT_LT(static_cast<size_t>(e.view), model->views.size());
        }
      }
    });
    EXPECT_GT(refused, 100) << which;
  }
}

// As they are uploaded.
TEST(CheckColmapFile, TakesTheFilesOfAModel) {
  const std::vector<std::string> files = TestFiles();
  const auto check = [](const char* name, const std::string& bytes) {
    return CheckColmapFile(name, bytes, "f").status();
  };
  EXPECT_EQ(check("cameras.bin", files[0]), absl::OkStatus());
  EXPECT_EQ(check("images.bin", files[1]), absl::OkStatus());
  EXPECT_EQ(check("points3D.bin", files[2]), absl::OkStatus());
  EXPECT_EQ(check("cameras.txt", "1 FOV 40 30 50 50 20 15 0.9\n2 PINHOLE 4 3 5 5 2 1\n"),
            absl::OkStatus());
  // Those of images that COLMAP took out of the model stay in the file.
  EXPECT_EQ(check("cameras.txt",
                  "1 PINHOLE 40 30 nan 50 20 15\n2 PINHOLE 40 30 9e9 9e9 20 15\n"
                  "3 PINHOLE 40 30 50 50 20 15\n4 PINHOLE 40 30 1 1 20 99\n"),
            absl::OkStatus());
  EXPECT_EQ(check("images.txt", "7 1 0 0 0 0 0 0 5 a.jpg\n\n"), absl::OkStatus());
  EXPECT_EQ(check("points3D.txt", ""), absl::OkStatus());
  EXPECT_EQ(check("points3D.txt", "1 0 0 4 9 9 9 0 7 0\n"), absl::OkStatus());
}

TEST(CheckColmapFile, SaysOfWhichPhotosThereAreCameras) {
  EXPECT_THAT(*CheckColmapFile("images.txt",
                               "7 1 0 0 0 0 0 0 5 left/b.jpg\n\n8 1 0 0 0 0 0 1 5 a.jpg\n\n", "f"),
              testing::ElementsAre("a.jpg", "left/b.jpg"));
  EXPECT_THAT(*CheckColmapFile("cameras.txt", "1 PINHOLE 40 30 50 50 20 15\n", "f"),
              testing::IsEmpty());
}

TEST(CheckColmapFile, RefusesWhatIsWrongWithAFileByItself) {
  const std::vector<std::string> files = TestFiles();
  const char* const names[] = {"cameras.bin", "images.bin", "points3D.bin"};
  for (size_t which = 0; which < 3; ++which) {
    const std::string cut = files[which].substr(0, files[which].size() - 1);
    EXPECT_EQ(Reason(CheckColmapFile(names[which], cut, "f").status()), "MODEL_TRUNCATED") << which;
  }
  struct Case {
    const char* name;
    std::string text;
    const char* reason;
  };
  for (const Case& c : std::vector<Case>{
           {"cameras.txt", "", "NO_CAMERAS"},
           {"cameras.txt", "1 PINHOLE 40 30 50 50 20\n", "MODEL_CORRUPT"},
           {"cameras.txt", "1 FOV 40 30 50 50 20 15 0.9\n", "UNSUPPORTED_CAMERA_MODEL"},
           {"cameras.txt", "1 PINHOLE 40 30 nan 50 20 15\n", "NOT_FINITE"},
           {"cameras.txt", "1 PINHOLE 40 30 1.1 1.1 20 15\n", "BAD_FOCAL_LENGTH"},
           {"cameras.txt", "1 PINHOLE 40 30 50 50 20 31\n", "BAD_PRINCIPAL_POINT"},
           {"cameras.txt", "1 PINHOLE 40 30 50 50 20 31\n2 PINHOLE 40 30 1 1 20 15\n",
            "BAD_PRINCIPAL_POINT"},
           {"images.txt", "", "NO_CAMERAS"},
           {"images.txt", "7 1 0 0 0 0 0 0 5 low/..\n\n", "BAD_FILE_NAME"},
           {"images.txt", "7 0 0 0 0 0 0 0 5 a.jpg\n\n", "MODEL_CORRUPT"},
           {"points3D.txt", "1 0 0 inf 9 9 9 0\n", "NOT_FINITE"}}) {
    const absl::Status status = CheckColmapFile(c.name, c.text, "f").status();
    EXPECT_EQ(Reason(status), c.reason) << c.name << ": " << c.text;
    EXPECT_THAT(std::string(status.message()), testing::StartsWith("f"));
  }
}

TEST(WriteColmapModel, RefusesTracksOfViewsThatDoNotExist) {
  TempDir dir;
  SparseModel model = TestModel();
  model.points[0].track[0].view = 6;
  EXPECT_EQ(Reason(WriteColmapModel(dir.path(), model)), "BAD_TRACK");
}

}  // namespace
}  // namespace litags
