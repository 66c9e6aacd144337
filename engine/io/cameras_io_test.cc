#include "engine/io/cameras_io.h"

#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr char kCameras[] = "1 PINHOLE 40 30 50 51 20 15\n";

SparseModel ModelOf(int views) {
  SparseModel model;
  for (int i = 0; i < views; ++i) {
    View view;
    view.name = absl::StrCat("p", i, ".jpg");
    view.camera.width = 40;
    view.camera.height = 30;
    view.camera.fx = view.camera.fy = 50;
    view.camera.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    model.views.push_back(view);
    model.distortions.emplace_back();
  }
  return model;
}

void Write(const fs::path& dir, int views) {
  fs::create_directories(dir);
  ASSERT_TRUE(WriteColmapModel(dir, ModelOf(views)).ok());
}

TEST(ResolveCameras, TakesTheLargestModelOfAFolder) {
  TempDir dir;
  const fs::path root = dir / "data";
  Write(root / "sparse" / "0", 3);
  Write(root / "sparse" / "1", 7);
  Write(root / "sparse" / "2", 4);
  EXPECT_EQ(ResolveCameras(root / "sparse"), (root / "sparse" / "1").string());
  EXPECT_EQ(ResolveCameras(root), (root / "sparse" / "1").string());
  EXPECT_EQ(ResolveCameras(root / "sparse" / "2"), (root / "sparse" / "2").string());
}

// As nerfstudio leaves it, whose transforms.json goes before it.
TEST(ResolveCameras, TakesTheModelInTheFolderColmapLast) {
  TempDir dir;
  Write(fs::path(dir / "colmap") / "sparse" / "0", 3);
  EXPECT_EQ(ResolveCameras(dir.path()), dir / "colmap/sparse/0");
  ASSERT_TRUE(WriteFileAtomically(dir / "transforms.json", "{}").ok());
  EXPECT_EQ(ResolveCameras(dir.path()), dir / "transforms.json");
}

// Some programs write one line for an image, COLMAP two.
TEST(ResolveCameras, CountsTheImagesOfTextModels) {
  TempDir dir;
  const std::string a = "1 1 0 0 0 0 0 0 1 a.jpg\n", b = "2 1 0 0 0 0 0 0 1 b c.jpg\n";
  for (const auto& [name, images] :
       {std::pair("0", "# images\n" + a + "1 2 -1\n"), std::pair("1", a + b)}) {
    fs::create_directories(fs::path(dir / "sparse") / name);
    const std::string model = absl::StrCat(dir / "sparse", "/", name);
    ASSERT_TRUE(WriteFileAtomically(model + "/cameras.txt", kCameras).ok());
    ASSERT_TRUE(WriteFileAtomically(model + "/images.txt", images).ok());
  }
  EXPECT_EQ(ResolveCameras(dir.path()), dir / "sparse/1");
}

TEST(ResolveCameras, TakesTheFileOfADataset) {
  TempDir dir;
  fs::create_directory(dir / "data");
  EXPECT_EQ(ResolveCameras(dir / "data"), dir / "data");
  const absl::Status status = ReadCameras(dir / "data", "cameras").status();
  EXPECT_EQ(Reason(status), "NO_CAMERAS_IN_FOLDER");
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("cameras.xml, bundle.out"));
  for (const char* name : {"bundle.out", "cameras.xml", "transforms.json"}) {  // later ones first
    const std::string path = dir / "data/" + name;
    ASSERT_TRUE(WriteFileAtomically(path, "{}").ok());
    EXPECT_EQ(ResolveCameras(dir / "data"), path);
  }
}

TEST(ReadColmapModel, NeedsNoFileOfPoints) {
  TempDir dir;
  Write(dir / "m", 3);
  fs::remove(dir / "m/points3D.bin");
  const auto model = ReadColmapModel(dir / "m", "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views.size(), 3u);
  EXPECT_TRUE(model->points.empty());
  fs::remove(dir / "m/images.bin");
  EXPECT_EQ(Reason(ReadColmapModel(dir / "m", "cameras").status()), "NO_SUCH_FILE");
}

constexpr char kPose[] = " 1 0 0 0 0 0 0 1 ";

TEST(ParseColmapText, ImagesMayHaveNoSecondLine) {
  const std::string images =
      absl::StrCat("1", kPose, "a.jpg\n2", kPose, "0002\n3", kPose, "c d (1).jpg\n");
  const auto model = ParseColmapText(kCameras, images, "", "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 3u);
  EXPECT_EQ(model->views[0].name, "0002");
  EXPECT_EQ(model->views[2].name, "c d (1).jpg");
}

TEST(ParseColmapText, SecondLinesOfNumbersStayObservations) {
  const std::string images =
      absl::StrCat("1", kPose, "a.jpg\n1 2 -1 3 4 -1 5 6 -1 7 8 9\n2", kPose, "b.jpg\n\n");
  const auto model = ParseColmapText(kCameras, images, "9 0 0 1 9 9 9 0.5 1 3\n", "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 2u);
  ASSERT_EQ(model->points.size(), 1u);
  EXPECT_EQ(model->points[0].track[0].x, 7);
}

TEST(ParseColmapText, MayBeginWithAByteOrderMark) {
  const std::string mark = "\xEF\xBB\xBF";
  const auto model = ParseColmapText(mark + kCameras, absl::StrCat(mark, "1", kPose, "a.jpg\n\n"),
                                     mark, "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views[0].name, "a.jpg");
}

}  // namespace
}  // namespace litags
