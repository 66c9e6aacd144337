// litags-inspect as its user sees it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/cameras_io.h"
#include "engine/io/colmap_io.h"
#include "engine/io/depth_io.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/readdir_test_util.h"
#include "engine/tools/contact_sheet/contact_sheet.h"
#include "engine/tools/inspect/dataset_folder.h"
#include "engine/tools/inspect/photo_sheet.h"
#include "engine/video/testing_video.h"
#include "tests/support/camera_layouts.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using testing::ContainsRegex;
using testing::HasSubstr;

class Inspect : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(photos_);
    const auto frames = WalkFrames(320, 240, 5, 6, {}), moved = WalkFrames(320, 240, 5, 6, {3});
    for (int i = 0; i < 5; ++i) {
      ImageU8 photo = frames[i];
      // The second is darker; of the fourth half is blurred by motion.
      for (size_t k = 0; k < photo.data.size(); ++k) {
        uint8_t& code = photo.data[k];
        if (i == 1) code /= 3;
        if (i == 3) code = static_cast<uint8_t>((code + moved[i].data[k]) / 2);
      }
      std::string jpeg = EncodeJpeg(photo).value();
      if (i == 2) jpeg = WithJpegExif(jpeg, FocalBlock(28, 35, 10));
      Write(absl::StrCat("p", i, ".jpg"), jpeg);
    }
    Write("bad.jpg", "no photo");
  }

  void Write(const std::string& name, const std::string& bytes) {
    ASSERT_TRUE(WriteFileAtomically(photos_ + "/" + name, bytes).ok());
  }

  // A transforms.json with cameras of the first so many photos.
  std::string WriteCameras(int count, const std::string& lens) {
    std::string frames;
    for (int i = 0; i < count; ++i) {
      absl::StrAppend(&frames, i > 0 ? "," : "", R"({"file_path": "p)", i,
                      R"(.jpg", "transform_matrix": [[1,0,0,)", i,
                      "],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}");
    }
    std::string path = dir_ / "transforms.json";
    const std::string json = absl::StrCat("{", lens, R"(, "frames": [)", frames, "]}");
    EXPECT_TRUE(WriteFileAtomically(path, json).ok());
    return path;
  }

  int Run(const std::vector<std::string>& arguments) {
    const SubprocessResult result = RunProgram(LITAGS_INSPECT, arguments);
    text_ = result.tail;
    return result.exit_code;
  }

  TempDir dir_;
  const std::string photos_ = dir_ / "photos";
  std::string text_;
};

TEST_F(Inspect, ReadsDepthMapsAsARunDoes) {
  const std::string maps = dir_ / "maps";
  fs::create_directory(maps);
  EXPECT_EQ(Run({photos_, "--depth", maps}), 2);
  EXPECT_THAT(text_, HasSubstr("DEPTH_MAP_WITHOUT_PHOTO"));
  Planes ramp(1, 240, 320);
  for (size_t i = 0; i < ramp.data.size(); ++i) ramp.data[i] = 1 + 0.01f * static_cast<float>(i);
  ASSERT_TRUE(WritePfm(maps + "/p0.pfm", ramp).ok());
  ASSERT_TRUE(WritePfm(maps + "/p3.pfm", ramp).ok());
  EXPECT_EQ(Run({photos_, "--depth", maps}), 0);
  EXPECT_THAT(text_, HasSubstr("\ndepth maps: 2 of 5 photos have one\n"));
  ASSERT_TRUE(WriteFileAtomically(maps + "/p1.png", EncodeMask(PlaneU8(320, 240)).value()).ok());
  EXPECT_EQ(Run({photos_, "--depth", maps}), 2);
  EXPECT_THAT(text_, HasSubstr("DEPTH_BITS"));
  fs::remove(maps + "/p1.png");
  ASSERT_TRUE(WritePfm(maps + "/p1.pfm", Planes(1, 100, 320)).ok());
  EXPECT_EQ(Run({photos_, "--depth", maps}), 2);
  EXPECT_THAT(text_, HasSubstr("DEPTH_MAP_SIZE"));
}

TEST_F(Inspect, SaysWhatWouldBeUsedAndWhatNot) {
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, ContainsRegex("p0.jpg +320x240 +- +- +[0-9.]+ +0[.]0 "));
  EXPECT_THAT(text_, HasSubstr("code: mean pixel value of 255; stops: "));
  // A third of the codes is some 3.6 stops less light.
  EXPECT_THAT(text_, ContainsRegex("p1.jpg +320x240 +- +- +[0-9.]+ +-[34][.][0-9] "));
  EXPECT_THAT(text_, ContainsRegex("p2.jpg +320x240 +28 mm "));
  // Somewhat blurred.
  EXPECT_THAT(text_, ContainsRegex("p3.jpg .* 0[.][0-8][0-9]  -"));
  EXPECT_THAT(text_, HasSubstr("5 photos would be used, 1 is left out"));
  EXPECT_THAT(text_, HasSubstr("bad.jpg is left out"));
  EXPECT_THAT(text_, ContainsRegex("a run would take 0.[0-9] GiB to 0.[0-9] GiB of memory; there "
                                   "are [0-9.]+ GiB"));
}

TEST_F(Inspect, NamesDoNotSteerTheTerminal) {
  fs::rename(photos_ + "/p0.jpg", photos_ + "/p\x1b[2J.jpg");
  fs::rename(photos_ + "/bad.jpg", photos_ + "/bad\x1b[2J.jpg");
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("p?[2J.jpg "));
  EXPECT_THAT(text_, HasSubstr("bad?[2J.jpg is left out"));
  EXPECT_EQ(Run({dir_ / "no\x1b[2Jwhere"}), 2);
  EXPECT_THAT(text_, HasSubstr("no?[2Jwhere"));
}

TEST_F(Inspect, OutputThatIsLostIsAnError) {
  const SubprocessResult result = RunIntoFullDevice(LITAGS_INSPECT, {photos_});
  EXPECT_EQ(result.exit_code, 1) << result.tail;
  EXPECT_THAT(result.tail, HasSubstr("not all of the output could be written"));
}

TEST_F(Inspect, ALinkToAPhotoThatIsGoneIsLeftOutByName) {
  fs::create_symlink("nowhere/p9.jpg", photos_ + "/p9.jpg");
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("5 photos would be used, 2 are left out"));
  EXPECT_THAT(text_, HasSubstr("p9.jpg is left out"));
}

// As phones write of a part of a panorama.
std::string WithPart(const std::string& jpeg, const std::string& part) {
  return WithJpegXmp(jpeg, "GPano:ProjectionType=\"equirectangular\" " + part);
}

// 22.5 degrees across.
TEST_F(Inspect, ASmallPartOfAPanoramaIsAPhoto) {
  Write("p0.jpg",
        WithPart(ReadFile(photos_ + "/p0.jpg", "", 1 << 20).value(),
                 "GPano:FullPanoWidthPixels=\"5120\" GPano:FullPanoHeightPixels=\"2560\" "
                 "GPano:CroppedAreaImageWidthPixels=\"320\" "
                 "GPano:CroppedAreaImageHeightPixels=\"240\" "
                 "GPano:CroppedAreaLeftPixels=\"2400\" GPano:CroppedAreaTopPixels=\"1160\""));
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("5 photos would be used, 1 is left out"));
}

TEST_F(Inspect, AStripThatTellsItsPartOfAPanoramaIsUsed) {
  ImageU8 strip(640, 80);
  for (size_t i = 0; i < strip.data.size(); ++i) {
    strip.data[i] = static_cast<uint8_t>(20 + (i / 3 * 2654435761u >> 8) % 60);
  }
  Write("p0.jpg", WithPart(EncodeJpeg(strip).value(),
                           "GPano:FullPanoWidthPixels=\"640\" GPano:FullPanoHeightPixels=\"320\" "
                           "GPano:CroppedAreaImageWidthPixels=\"640\" "
                           "GPano:CroppedAreaImageHeightPixels=\"80\" "
                           "GPano:CroppedAreaLeftPixels=\"0\" GPano:CroppedAreaTopPixels=\"120\""));
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("part of a panorama: 4 views"));
  EXPECT_THAT(text_, HasSubstr("5 photos would be used, as 8 views, 1 is left out"));
}

TEST_F(Inspect, NamesInUtf8KeepTheColumns) {
  fs::rename(photos_ + "/p0.jpg", photos_ + "/k\u00fcche.jpg");
  ASSERT_EQ(Run({photos_}), 0) << text_;
  for (const std::string name : {"k\u00fcche.jpg    ", "p1.jpg       "}) {
    EXPECT_THAT(text_, HasSubstr(absl::StrCat("\n", name, std::string(20, ' '), "320x240")));
  }
}

TEST_F(Inspect, NamesWhatElseLiesThere) {
  fs::create_directories(photos_ + "/sub");
  fs::copy(photos_ + "/p0.jpg", photos_ + "/sub/0007.JPG");
  Write("notes.txt", "x");
  Write("clip.webm", "x");
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("note: not read: clip.webm (a video: give it alone), notes.txt\n"));
  EXPECT_THAT(text_, HasSubstr("note: 1 photo in sub/ is not used"));
}

TEST_F(Inspect, AFolderOfFoldersIsAnsweredWithThem) {
  for (const char* name : {"DCIM", "DCIM/b", "DCIM/a"}) {
    fs::create_directory(dir_ / name);
    fs::copy(photos_ + "/p0.jpg", dir_ / (std::string(name) + "/p0.jpg"));
  }
  fs::remove(dir_ / "DCIM/p0.jpg");
  EXPECT_EQ(Run({dir_ / "DCIM"}), 2);
  EXPECT_THAT(text_, HasSubstr(dir_ / "DCIM" + " holds no photos itself: did you mean " +
                               dir_ / "DCIM/a" + ", " + dir_ / "DCIM/b" + "?"));
  EXPECT_THAT(text_, HasSubstr("reason NO_PHOTOS"));
}

TEST_F(Inspect, FoldersOfARigAreAnsweredWithWhatToDo) {
  for (const char* name : {"rig/images/cam0", "rig/images/cam1"}) {
    fs::create_directories(dir_ / name);
    fs::copy(photos_ + "/p0.jpg", dir_ / (std::string(name) + "/p0.jpg"));
  }
  for (const char* name : {"rig", "rig/images"}) {
    EXPECT_EQ(Run({dir_ / name}), 2);
    EXPECT_THAT(text_, HasSubstr("did you mean " + dir_ / "rig/images/cam0"));
    EXPECT_THAT(text_, HasSubstr("copy them to one folder as cam1_p0.jpg"));
  }
}

TEST_F(Inspect, WhatIsNoFolderOfPhotosIsAnsweredWithWhatToGive) {
  Write("night.ZIP", "x");
  Write("night.mpg", "x");
  fs::create_directory(dir_ / "none");
  for (const auto& [given, words] :
       {std::pair(photos_ + "/p0.jpg", "/p0.jpg is a file; give the folder that holds it"),
        std::pair(photos_ + "/night.ZIP", "/night.ZIP is a file; unpack it and give the folder, "),
        std::pair(photos_ + "/night.mpg", "rename a video to end in one of .mp4 .mov "),
        std::pair(dir_ / "none", "; give the folder that holds the photos")}) {
    EXPECT_EQ(Run({given}), 2);
    EXPECT_THAT(text_, HasSubstr(words));
  }
}

// nerfstudio's, with cameras of 3DGS beside them.
TEST_F(Inspect, AFolderOfADatasetIsReadAsAnArchiveOfIt) {
  const fs::path root = dir_ / "room";
  for (const char* folder : {"images", "images_2", "sparse/0", "masks"}) {
    fs::create_directories(root / folder);
  }
  fs::copy(photos_, root / "images");
  fs::copy(photos_ + "/p0.jpg", root / "images_2/p0.jpg");
  PlaneU8 mask(320, 240);
  std::fill(mask.data.begin(), mask.data.end(), 255);
  ASSERT_TRUE(WriteFileAtomically(root / "masks/p0.jpg.png", EncodeMask(mask).value()).ok());
  SparseModel model;
  Camera camera;
  camera.width = 320, camera.height = 240;
  camera.fx = camera.fy = 300, camera.cx = 160, camera.cy = 120;
  model.views = {{"p0.jpg", camera}};
  model.distortions.resize(1);
  ASSERT_TRUE(WriteColmapModel(root / "sparse/0", model).ok());
  ASSERT_TRUE(WriteFileAtomically(root / "transforms.json", "{}").ok());
  EXPECT_EQ(Run({root}), 2);
  EXPECT_THAT(text_, HasSubstr("photos: those in " + (root / "images").string() + "\n"));
  EXPECT_THAT(text_, HasSubstr("cameras: those in " + (root / "sparse/0").string() + "\n"));
  EXPECT_THAT(text_, HasSubstr("masks: those in " + (root / "masks").string() + "\n"));
  EXPECT_THAT(text_, HasSubstr("not used: images_2/ (the photos are those in images/)"));
  EXPECT_THAT(text_, HasSubstr("not used: transforms.json (the cameras are those in sparse/0)"));
  EXPECT_THAT(text_, HasSubstr("images: 1 of 6 photos have a camera"));
}

// As litags submit, of one table.
TEST(DatasetFolder, OfSeveralCamerasTheFirstOfTheListIsTaken) {
  const auto layouts = CameraLayout::All();
  ASSERT_FALSE(layouts.empty());
  TempDir temp;
  const std::string dir = temp / "d";
  for (const CameraLayout& layout : layouts) {
    layout.Write(dir);
    SCOPED_TRACE(layout.files[0].first);
    const std::string named = CameraLayout::Seen(ResolveCameras(dir), dir);
    EXPECT_EQ(named, layout.named == "-" ? "." : layout.named);
    std::string photos = dir, cameras, masks, depth;
    const absl::Status status = UseDatasetFolder(true, &photos, &cameras, &masks, &depth);
    if (layout.alone == "?") {
      EXPECT_EQ(Reason(status), "CAMERAS_TWICE");
      continue;
    }
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_EQ(cameras.empty() ? "-" : CameraLayout::Seen(cameras, dir), layout.alone);
  }
}

TEST(DatasetFolder, MayBeOfLinksToFolders) {
  TempDir temp;
  for (const char* file : {"raw/a.jpg", "model/0/cameras.bin", "covers/a.png"}) {
    fs::create_directories(fs::path(temp / file).parent_path());
    ASSERT_TRUE(WriteFileAtomically(temp / file, "x").ok());
  }
  const std::string dir = temp / "d";
  fs::create_directory(dir);
  fs::create_symlink("../raw", dir + "/images");
  fs::create_symlink("images", dir + "/images_2");
  fs::create_symlink("../model", dir + "/sparse");
  fs::create_symlink("../covers", dir + "/masks");
  std::string photos = dir, cameras, masks, depth;
  const absl::Status status = UseDatasetFolder(true, &photos, &cameras, &masks, &depth);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(photos, dir + "/images");
  EXPECT_EQ(cameras, dir + "/sparse/0");
  EXPECT_EQ(masks, dir + "/masks");
}

TEST(DatasetFolder, HasDepthMapsByTheNamesThatARunFinds) {
  TempDir temp;
  for (const char* map : {"a.npy", "a.JPG.PFM", "a.PNG", "a.exr", ".npy"}) {
    const std::string dir = temp / map;
    for (const std::string& file : {std::string("images/a.JPG"), absl::StrCat("depth/", map)}) {
      fs::create_directories(fs::path(dir + "/" + file).parent_path());
      ASSERT_TRUE(WriteFileAtomically(dir + "/" + file, "x").ok());
    }
    std::string photos = dir, cameras, masks, depth;
    ASSERT_TRUE(UseDatasetFolder(true, &photos, &cameras, &masks, &depth).ok());
    const bool found = !FindDepthMap(dir + "/depth", "a.JPG").empty();
    EXPECT_EQ(depth, found ? dir + "/depth" : "") << map;
    EXPECT_EQ(found, std::string(map) != "a.exr" && std::string(map) != ".npy") << map;
  }
}

TEST(DatasetFolder, ThatCannotBeReadToItsEndIsAnErrorNotASmallerOne) {
  TempDir temp;
  const std::string dir = temp / "d";
  fs::create_directories(dir + "/images");
  ASSERT_TRUE(WriteFileAtomically(dir + "/images/a.jpg", "x").ok());
  ASSERT_TRUE(WriteFileAtomically(dir + "/transforms.json", "x").ok());
  const auto use = [&] {
    std::string photos = dir, cameras, masks, depth;
    return UseDatasetFolder(true, &photos, &cameras, &masks, &depth);
  };
  ASSERT_TRUE(use().ok());
  // It is read for photos of its own, for other pictures (each ".", "..", two names and the end),
  // and then with its folders.
  for (const int before : {10, 13}) {
    readdirs_before_failure = before;
    EXPECT_EQ(Reason(use()), "IO_ERROR") << before;
    EXPECT_EQ(readdirs_before_failure, -1);
  }
}

TEST_F(Inspect, DepthOfADatasetThatIsNotReadIsNotUsed) {
  fs::create_directories(dir_ / "room/images");
  fs::copy(photos_, dir_ / "room/images");
  fs::create_directory(dir_ / "room/depth");
  ASSERT_TRUE(WriteFileAtomically(dir_ / "room/depth/p0.exr", "x").ok());
  EXPECT_EQ(Run({dir_ / "room"}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("not used: " + (dir_ / "room/depth") +
                               " (it holds no depth maps: .png .pfm .npy)\n"));
}

TEST_F(Inspect, CamerasOfADatasetThatNoRuleTellsApartAreRefused) {
  fs::create_directories(dir_ / "room/images");
  fs::copy(photos_, dir_ / "room/images");
  for (const char* name : {"room/cameras.xml", "room/sfm_data.json"}) {
    ASSERT_TRUE(WriteFileAtomically(dir_ / name, "x").ok());
  }
  EXPECT_EQ(Run({dir_ / "room"}), 2);
  EXPECT_THAT(text_, HasSubstr("reason CAMERAS_TWICE, field --cameras"));
}

TEST_F(Inspect, TooFewPhotosAreRefusedAsByARun) {
  fs::create_directory(dir_ / "one");
  fs::copy(photos_ + "/p0.jpg", dir_ / "one/p0.jpg");
  EXPECT_EQ(Run({dir_ / "one"}), 2);
  EXPECT_THAT(text_, HasSubstr("1 photo would be used, 0 are left out"));
  EXPECT_THAT(text_, HasSubstr("images: 1 photo; a scene needs at least 3"));
  EXPECT_THAT(text_, HasSubstr("reason TOO_FEW_PHOTOS"));
}

TEST_F(Inspect, AMaskThatARunRefusesEndsWithTwo) {
  const std::string masks = dir_ / "masks";
  fs::create_directory(masks);
  PlaneU8 half(320, 240), other(160, 120);
  std::fill_n(half.data.begin(), half.data.size() / 2, 255);
  std::fill(other.data.begin(), other.data.end(), 255);
  const auto of = [](const PlaneU8& mask) { return EncodeMask(mask).value(); };
  const auto run = [&](const std::string& mask) {
    EXPECT_TRUE(WriteFileAtomically(masks + "/p3.png", mask).ok());
    return Run({photos_, "--masks", masks});
  };
  ASSERT_EQ(run(of(half)), 0) << text_;
  for (const auto& [mask, reason] : std::vector<std::pair<std::string, std::string>>{
           {EncodePng16(DecodePhoto(of(half), "mask").value()).value(), "MASK_FORMAT"},
           {of(other), "MASK_SIZE"},
           {of(PlaneU8(320, 240)), "MASK_BLACK"},
           {"x", "IMAGE_NOT_RECOGNIZED"}}) {
    EXPECT_EQ(run(mask), 2) << reason;
    EXPECT_THAT(text_, HasSubstr("reason " + reason + ", field masks[p3.png]"));
  }
  // Its photo is left out, and so is it.
  fs::rename(masks + "/p3.png", masks + "/bad.png");
  EXPECT_EQ(Run({photos_, "--masks", masks}), 0) << text_;
}

TEST_F(Inspect, NamesPanoramasAndTheirViews) {
  ImageU8 sky(128, 64);
  for (int x = 0; x < 128; ++x) {
    for (int y = 0; y < 64; ++y) {
      sky.pixel(x, y)[0] = static_cast<uint8_t>(90 + 60 * std::cos(2 * M_PI * x / 128) + y);
    }
  }
  for (const char* name : {"s0.png", "s1.png", "s2.png"}) {
    sky.pixel(5, 5)[2] = static_cast<uint8_t>(name[1]);  // not the same photo
    Write(name, EncodePng(sky).value());
  }
  ASSERT_EQ(Run({photos_}), 0) << text_;
  EXPECT_THAT(text_, ContainsRegex("s1.png +128x64 +panorama: 6 views"));
  EXPECT_THAT(text_, HasSubstr("8 photos would be used, as 23 views"));
  EXPECT_THAT(text_, HasSubstr("note: 3 photos are panoramas of the whole sphere, such as s0.png"));
}

TEST_F(Inspect, NamesFisheyesOfGivenCameras) {
  const std::string cameras = WriteCameras(5, R"("camera_model": "OPENCV_FISHEYE", "fl_x": 100)");
  ASSERT_EQ(Run({photos_, "--cameras", cameras}), 0) << text_;
  EXPECT_THAT(text_, ContainsRegex("p1.jpg +320x240 +fisheye: 5 views .* yes"));
}

TEST_F(Inspect, PhotosWithoutACameraAreCountedAsLeftOut) {
  const std::string cameras = WriteCameras(3, R"("fl_x": 300)");
  ASSERT_EQ(Run({photos_, "--cameras", cameras}), 0) << text_;
  EXPECT_THAT(text_, ContainsRegex("p2.jpg .* yes\n"));
  EXPECT_THAT(text_, ContainsRegex("p3.jpg .* none: left out\n"));
  EXPECT_THAT(text_, HasSubstr("\n3 photos would be used, 3 are left out; cameras: "));
}

TEST_F(Inspect, DrawsAContactSheet) {
  for (const char* name : {"sheet.jpg", "sheet.png"}) {
    const std::string sheet = dir_ / name;
    ASSERT_EQ(Run({photos_, "--contact-sheet", sheet}), 0) << text_;
    EXPECT_THAT(text_, HasSubstr("contact sheet: " + sheet));
    const auto picture = ReadImage(sheet, name);
    ASSERT_TRUE(picture.ok()) << picture.status();
    EXPECT_GT(picture->width, 5 * 320);
    EXPECT_GT(picture->height, 240);
  }
  EXPECT_EQ(Run({photos_, "--contact-sheet", dir_ / "sheet.bmp"}), 2);
  EXPECT_THAT(text_, HasSubstr("a name that ends in .png, .jpg or .jpeg"));
  EXPECT_FALSE(fs::exists(dir_ / "sheet.bmp"));
  EXPECT_EQ(Run({photos_, "--contact-sheet", dir_ / "nowhere/sheet.jpg"}), 2);
  EXPECT_THAT(text_, HasSubstr("5 photos would be used")) << "and says what was found";
}

// They were empty cells, though one wants to see whether they are blurred.
TEST_F(Inspect, DrawsPhotosThatAreLeftOut) {
  fs::copy(photos_ + "/p0.jpg", photos_ + "/p0 (1).jpg");
  ASSERT_EQ(Run({photos_, "--contact-sheet", dir_ / "sheet.png"}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("5 photos would be used, 2 are left out"));
  const auto sheet = ReadImage(dir_ / "sheet.png", "sheet");
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  int empty = 0;  // pixels of cells without a picture: that of bad.jpg
  for (size_t i = 0; i < sheet->data.size(); i += 3) {
    empty += sheet->data[i] == 226 && sheet->data[i + 1] == 226 && sheet->data[i + 2] == 224;
  }
  EXPECT_LE(empty, 320 * 240);
  EXPECT_GT(empty, 300 * 230);
}

TEST_F(Inspect, DrawsManyPhotosThatAreLeftOut) {
  for (int i = 0; i < 280; ++i) Write(absl::StrCat("bad", i, ".jpg"), "no photo");
  ASSERT_EQ(Run({photos_, "--contact-sheet", dir_ / "sheet.jpg"}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("281 are left out"));
}

TEST(PlanSheet, KeepsLargeFoldersWithinAJpeg) {
  for (const int count : {1, 7, 800, 1200, 5000, 20000}) {
    PhotoScreen screen;
    screen.photos.resize(count);
    for (ScreenedPhoto& photo : screen.photos) photo.width = 3000, photo.height = 4000;
    screen.left_out.resize(count / 2);
    const SheetPlan plan = PlanSheet(screen);
    const auto rows_of = [&](size_t photos) {
      return static_cast<double>((photos + plan.columns - 1) / plan.columns);
    };
    const double height =
        110 + rows_of(count) * (std::ceil(plan.cell_width * 4 / 3.0) + CaptionHeight(1) + 8) +
        rows_of(count / 2) * (plan.cell_width * 3 / 4.0 + CaptionHeight(kCaptionLines) + 8);
    EXPECT_LE(height, 65500) << count;
    EXPECT_LE(plan.columns * (plan.cell_width + 8), 65000) << count;
    EXPECT_GE(plan.cell_width, 200) << count;
    EXPECT_EQ(plan.columns == std::min<size_t>(count, 6), count <= 800) << count;
    EXPECT_LE(plan.cell_width, 320);
  }
}

TEST_F(Inspect, AVideoIsInspectedByItsFrames) {
  const std::string video = dir_ / "night.mov";
  ASSERT_TRUE(WriteFileAtomically(video, EncodeVideo(WalkFrames(320, 180, 60, 4), {})).ok());
  ASSERT_EQ(Run({video, "--frames", "8"}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("8 of the 60 frames of night.mov"));
  EXPECT_THAT(text_, HasSubstr("8 photos would be used, 0 are left out"));
}

TEST_F(Inspect, MistakesAreOneError) {
  EXPECT_EQ(Run({dir_ / "nowhere"}), 2);
  EXPECT_THAT(text_, HasSubstr("reason NO_SUCH_FOLDER"));
  EXPECT_EQ(Run({dir_ / "none.mov"}), 2);
  EXPECT_THAT(text_, HasSubstr("none.mov: there is no such file"));
  EXPECT_EQ(Run({}), 2);
}

}  // namespace
}  // namespace litags
