#include "client/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cameras_source.h"
#include "client/client_test_util.h"
#include "client/status.h"
#include "client/upload.h"
#include "tests/support/camera_layouts.h"

namespace litags::client {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ScanCaptureTest : public FolderTest {};

TEST_F(ScanCaptureTest, FindsPhotosAndNamesTheRest) {
  Write("b.jpg", "x");
  Write("a.png", "xy");
  Write("notes.txt", "x");
  Write(".hidden.jpg", "x");
  Write("sub/c.jpg", "x");
  const auto capture = ScanCapture(dir_.string(), "", "", "");
  ASSERT_TRUE(capture.ok());
  ASSERT_EQ(capture->files.size(), 2u);
  EXPECT_EQ(capture->files[0].name, "a.png");
  EXPECT_EQ(capture->bytes, 3);
  EXPECT_THAT(capture->skipped, ElementsAre("notes.txt"));
}

TEST_F(ScanCaptureTest, NamesALinkToAPhotoThatIsGone) {
  Write("a.jpg", "x");
  fs::create_directory(dir_ / "folder.jpg");
  fs::create_symlink("nowhere/b.jpg", dir_ / "b.jpg");
  auto capture = ScanCapture(dir_.string(), "", "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  ASSERT_EQ(capture->files.size(), 2u);
  const absl::Status status =
      ContentDigest(capture->files, Interrupt(), [](const LocalFile&) {}).status();
  EXPECT_EQ(DetailOf(status).reason(), "FILE_UNREADABLE");
  EXPECT_EQ(DetailOf(status).field(), (dir_ / "b.jpg").string());
  EXPECT_THAT(std::string(status.message()), HasSubstr("No such file"));
}

TEST_F(ScanCaptureTest, SaysWhichPhotosOfSubfoldersAreNotUsed) {
  for (const char* name : {"a.jpg", "day/1.jpg", "day/2.jpg", "cut/1.jpg", "depth/a.png",
                           "masks/a.png", ".trash/1.jpg", "text/a.txt"}) {
    Write(name, "x");
  }
  const auto capture = ScanCapture(dir_.string(), "", (dir_ / "depth").string(), "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_THAT(capture->notes,
              ElementsAre("1 photo in cut/ is not used", "2 photos in day/ are not used"));
}

TEST_F(ScanCaptureTest, TheTitleIsTheFoldersName) {
  EXPECT_EQ(DefaultTitle("/home/a/kitchen"), "kitchen");
  EXPECT_EQ(DefaultTitle("kitchen/"), "kitchen");
  EXPECT_EQ(DefaultTitle("."), fs::current_path().filename().string());
  EXPECT_EQ(DefaultTitle("kitchen/../night.mp4"), "night.mp4");
  EXPECT_EQ(DefaultTitle("two\nlines"), "");
  EXPECT_EQ(DefaultTitle("no UTF-8 \xff"), "");
  EXPECT_EQ(DefaultTitle(std::string(201, 'a')), "");
}

TEST_F(ScanCaptureTest, TakesMasksBesideThePhotosOrOfAFolder) {
  Write("a.jpg", "x");
  EXPECT_EQ(ScanCapture(dir_.string(), "", "", "")->masks_dir, "");
  Write("masks/a.jpg.png", "y");
  Write("other/a.png", "z");
  for (const std::string given : {"", "other"}) {
    const auto capture =
        ScanCapture(dir_.string(), "", "", given.empty() ? "" : (dir_ / given).string());
    ASSERT_TRUE(capture.ok()) << capture.status();
    ASSERT_EQ(capture->files.size(), 2u);
    EXPECT_EQ(capture->files[1].role, v1::FILE_ROLE_MASK);
    EXPECT_EQ(capture->files[1].name, given.empty() ? "a.jpg.png" : "a.png");
    EXPECT_EQ(capture->masks_dir, (dir_ / (given.empty() ? "masks" : given)).string());
  }
  EXPECT_THAT(
      std::string(ScanCapture(dir_.string(), "", "", (dir_ / "gone").string()).status().message()),
      HasSubstr("there is no such folder; give the folder that holds the masks"));
  Write("none/readme.txt", "x");
  EXPECT_EQ(
      DetailOf(ScanCapture(dir_.string(), "", "", (dir_ / "none").string()).status()).reason(),
      "NO_MASKS");
}

TEST_F(ScanCaptureTest, TakesTheLargestModelOfAFolder) {
  Write("a.jpg", "x");
  for (const auto& [dir, count] : {std::pair("m/sparse/0", '\2'), std::pair("m/sparse/1", '\5')}) {
    Write(absl::StrCat(dir, "/cameras.bin"), "x");
    Write(absl::StrCat(dir, "/images.bin"), std::string(1, count) + std::string(7, '\0'));
  }
  const auto capture = ScanCapture(dir_.string(), (dir_ / "m").string(), "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  ASSERT_EQ(capture->files.size(), 3u);  // no file of points
  EXPECT_EQ(capture->files[1].path, (dir_ / "m/sparse/1/cameras.bin").string());
  EXPECT_THAT(capture->notes, ElementsAre(HasSubstr("m/sparse/1")));
}

TEST_F(ScanCaptureTest, TakesTheModelThatNerfstudioLeavesWhereNothingElseIs) {
  Write("a.jpg", "x");
  Write("n/colmap/sparse/0/cameras.bin", "x");
  Write("n/colmap/sparse/0/images.bin", std::string(8, '\1'));
  auto capture = ScanCapture(dir_.string(), (dir_ / "n").string(), "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_THAT(capture->notes, ElementsAre(HasSubstr("n/colmap/sparse/0")));
  Write("n/transforms.json", "{}");
  capture = ScanCapture(dir_.string(), (dir_ / "n").string(), "", "");
  EXPECT_THAT(capture->notes, ElementsAre(HasSubstr("n/transforms.json")));
}

TEST_F(ScanCaptureTest, TakesImagesAndCamerasOfADatasetsFolder) {
  for (const char* cameras :
       {"sparse/0/cameras.bin", "colmap/sparse/0/cameras.bin", "transforms.json"}) {
    fs::remove_all(dir_ / "d");
    for (const char* name : {"images/a.jpg", "images_2/a.jpg", "masks/a.png", "depths/a.npy"}) {
      Write(absl::StrCat("d/", name), "x");
    }
    Write(absl::StrCat("d/", cameras), "x");
    if (std::string(cameras) != "transforms.json") {
      Write((fs::path("d") / cameras).parent_path() / "images.bin", std::string(8, '\1'));
    }
    const auto capture = ScanCapture((dir_ / "d").string(), "", "", "");
    ASSERT_TRUE(capture.ok()) << capture.status();
    std::set<std::string> sent;
    for (const LocalFile& file : capture->files) {
      sent.insert(fs::path(file.path).lexically_relative(dir_ / "d").string());
    }
    for (const char* used : {"images/a.jpg", cameras, "depths/a.npy", "masks/a.png"}) {
      EXPECT_TRUE(sent.contains(used)) << used;
    }
    EXPECT_FALSE(sent.contains("images_2/a.jpg"));
    EXPECT_THAT(capture->notes, ElementsAre(HasSubstr("photos: "), HasSubstr("cameras: "),
                                            "1 photo in images_2/ is not used"));
  }
}

// As litags inspect, of one table.
TEST_F(ScanCaptureTest, OfSeveralCamerasOfAFolderTheFirstOfTheListIsTaken) {
  const auto layouts = CameraLayout::All();
  ASSERT_FALSE(layouts.empty());
  for (const CameraLayout& layout : layouts) {
    layout.Write(dir_ / "d");
    SCOPED_TRACE(layout.files[0].first);
    const std::string named = CameraLayout::Seen(ResolveCameras(dir_ / "d"), dir_ / "d");
    EXPECT_EQ(named, layout.named == "-" ? "." : layout.named);
    for (const fs::path& dir : {dir_ / "d", dir_ / "d/"}) {
      const auto alone = CamerasOfDataset(dir, "images");
      if (layout.alone == "?") {
        EXPECT_EQ(DetailOf(alone.status()).reason(), "CAMERAS_TWICE");
        EXPECT_EQ(DetailOf(alone.status()).field(), "--cameras");
        continue;
      }
      ASSERT_TRUE(alone.ok()) << alone.status();
      const std::string used = alone->used.empty() ? "-" : CameraLayout::Seen(alone->used, dir);
      EXPECT_EQ(used, layout.alone);
    }
  }
}

TEST_F(ScanCaptureTest, SaysWhichCamerasOfADatasetAreNotUsed) {
  Write("d/images/a.jpg", "x");
  Write("d/transforms.json", "{}");
  Write("d/colmap_text/cameras.txt", "x");
  const auto capture = ScanCapture((dir_ / "d").string(), "", "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_THAT(capture->notes, ElementsAre(HasSubstr("photos: "), HasSubstr("d/transforms.json"),
                                          "cameras that are not used: colmap_text"));
}

TEST_F(ScanCaptureTest, WhatTheUserNamesGoesBeforeWhatADatasetHolds) {
  Write("d/images/a.jpg", "x");
  Write("d/transforms.json", "{}");
  Write("mine.json", "{}");
  const auto capture = ScanCapture((dir_ / "d").string(), (dir_ / "mine.json").string(), "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_EQ(capture->files[1].name, "mine.json");
}

TEST_F(ScanCaptureTest, AFolderThatIsNamedForDepthHoldsMaps) {
  Write("d/images/a.jpg", "x");
  Write("d/depths/a.exr", "x");
  const std::string maps = (dir_ / "d/depths").string();
  const absl::Status status = ScanCapture((dir_ / "d").string(), "", maps, "").status();
  EXPECT_EQ(DetailOf(status).reason(), "NO_DEPTH_MAPS");
  EXPECT_EQ(DetailOf(status).field(), "--depth");
  EXPECT_THAT(std::string(status.message()), HasSubstr(".png .pfm .npy"));
  // Nobody named what a dataset holds.
  const auto capture = ScanCapture((dir_ / "d").string(), "", "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_EQ(capture->files.size(), 1u);
  EXPECT_THAT(capture->skipped, IsEmpty());
  EXPECT_THAT(capture->notes,
              Contains("not used: " + maps + " (it holds no depth maps: .png .pfm .npy)"));
}

// Programs write one line or two for an image.
TEST_F(ScanCaptureTest, TakesTheLargestModelInTextForm) {
  Write("a.jpg", "x");
  const std::string a = "1 1 0 0 0 0 0 0 1 a.jpg\n", b = "2 1 0 0 0 0 0 0 1 b.jpg\n";
  for (const auto& [model, images] : {std::pair("0", a + "1 2 -1\n"), std::pair("1", a + b)}) {
    Write(absl::StrCat("m/", model, "/cameras.txt"), "x");
    Write(absl::StrCat("m/", model, "/images.txt"), images);
  }
  const auto capture = ScanCapture(dir_.string(), (dir_ / "m").string(), "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_THAT(capture->notes, ElementsAre(HasSubstr("m/1")));
}

// As COLMAP's recipe for known poses has it.
TEST_F(ScanCaptureTest, AModelMayHaveAnEmptyFileOfPoints) {
  Write("a.jpg", "x");
  for (const char* name : {"m/cameras.txt", "m/images.txt"}) Write(name, "x");
  Write("m/points3D.txt", "");
  const auto capture = ScanCapture(dir_.string(), (dir_ / "m").string(), "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  std::set<std::string> names;
  for (const LocalFile& file : capture->files) names.insert(file.name);
  EXPECT_THAT(names, ElementsAre("a.jpg", "cameras.txt", "images.txt"));
}

TEST_F(ScanCaptureTest, AFolderWithoutCamerasSaysWhatItLooksFor) {
  Write("a.jpg", "x");
  Write("c/readme.txt", "x");
  const auto capture = ScanCapture(dir_.string(), (dir_ / "c").string(), "", "");
  EXPECT_THAT(std::string(capture.status().message()),
              HasSubstr("nor transforms.json, sfm_data.json"));
}

TEST_F(ScanCaptureTest, TakesTheListOfABundlerFileAlong) {
  Write("a.jpg", "x");
  for (const char* name : {"b/list.txt", "c/capture.lst"}) {
    Write(name, "a.jpg\n");
    const std::string folder(name, 1);
    Write(folder + "/bundle.out", "# Bundle file v0.3\n1 0\n");
  }
  for (const char* cameras : {"b", "b/bundle.out", "c"}) {
    const auto capture = ScanCapture(dir_.string(), (dir_ / cameras).string(), "", "");
    ASSERT_TRUE(capture.ok()) << capture.status();
    ASSERT_EQ(capture->files.size(), 2u);
    EXPECT_EQ(capture->files[1].name, "bundle.out");
    EXPECT_EQ(capture->files[1].tail, "\na.jpg\n");
    EXPECT_EQ(capture->files[1].size_bytes, 23 + 7);
  }
}

TEST_F(ScanCaptureTest, SaysWhatPicturesThereAreInstead) {
  Write("1.bmp", "x");
  Write("2.EXR", "x");
  const absl::Status status = ScanCapture(dir_.string(), "", "", "").status();
  EXPECT_EQ(DetailOf(status).reason(), "NO_PHOTOS");
  EXPECT_THAT(std::string(status.message()), HasSubstr("2 files are of a kind that is not read"));
}

TEST_F(ScanCaptureTest, RefusesMissingEmptyAndPhotolessFolders) {
  EXPECT_EQ(DetailOf(ScanCapture((dir_ / "none").string(), "", "", "").status()).reason(),
            "FOLDER_MISSING");
  EXPECT_THAT(std::string(ScanCapture((dir_ / "none.mp4").string(), "", "", "").status().message()),
              HasSubstr("none.mp4: there is no such file"));
  EXPECT_EQ(DetailOf(ScanCapture(dir_.string(), "", "", "").status()).reason(), "FOLDER_EMPTY");
  Write("night.mpg", "x");
  const absl::Status file = ScanCapture((dir_ / "night.mpg").string(), "", "", "").status();
  EXPECT_EQ(DetailOf(file).reason(), "FOLDER_MISSING");
  EXPECT_THAT(std::string(file.message()),
              HasSubstr("rename a video to end in one of .mp4 .mov .m4v "));
  fs::remove(dir_ / "night.mpg");
  Write("low/a.jpg", "x");
  Write("high/a.jpg", "x");
  const absl::Status status = ScanCapture(dir_.string(), "", "", "").status();
  EXPECT_EQ(DetailOf(status).reason(), "NO_PHOTOS");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr(absl::StrCat("did you mean ", (dir_ / "high").string(), ", ",
                                     (dir_ / "low").string(), "?")));
}

TEST_F(ScanCaptureTest, FoldersOfARigAreAnsweredWithWhatToDo) {
  for (const char* name : {"images/cam0/1.jpg", "images/cam1/1.jpg", "sparse/0/cameras.bin"}) {
    Write(name, "x");
  }
  for (const fs::path& dir : {dir_, dir_ / "images"}) {
    const absl::Status status = ScanCapture(dir.string(), "", "", "").status();
    EXPECT_EQ(DetailOf(status).reason(), "NO_PHOTOS");
    EXPECT_THAT(std::string(status.message()), HasSubstr((dir_ / "images/cam0").string()));
    EXPECT_THAT(std::string(status.message()), HasSubstr("copy them to one folder as cam1_1.jpg"));
  }
}

TEST_F(ScanCaptureTest, AnInterruptEndsTheReadingOfFiles) {
  Write("a.jpg", "x");
  auto capture = ScanCapture(dir_.string(), "", "", "");
  ASSERT_TRUE(capture.ok());
  Interrupt interrupt;
  int read = 0;
  const auto count = [&](const LocalFile&) { ++read; };
  EXPECT_TRUE(ContentDigest(capture->files, interrupt, count).ok());
  EXPECT_EQ(read, 1);
  interrupt.Raise();
  capture->files[0].sha256.clear();
  EXPECT_TRUE(absl::IsCancelled(ContentDigest(capture->files, interrupt, count).status()));
}

TEST_F(ScanCaptureTest, DigestsAreThoseOfTheStandard) {
  Write("abc", "abc");
  // FIPS 180-2, appendix B.1.
  const auto digest = FileSha256((dir_ / "abc").string(), Interrupt());
  ASSERT_TRUE(digest.ok());
  std::string hex;
  for (const unsigned char byte : *digest) absl::StrAppend(&hex, absl::Hex(byte, absl::kZeroPad2));
  EXPECT_EQ(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

}  // namespace
}  // namespace litags::client
