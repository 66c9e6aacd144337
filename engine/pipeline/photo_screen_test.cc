// What of a folder is used, and that what is no scene is not learnt: whole jobs on captures of the
// sample room with the trouble that people's folders have.
#include "engine/pipeline/photo_screen.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/io/depth_io.h"
#include "engine/io/dng.h"
#include "engine/io/file_util.h"
#include "engine/io/mask_io.h"
#include "engine/io/png_codes.h"
#include "engine/io/test_util.h"
#include "engine/io/transforms_io.h"
#include "engine/pipeline/capture_test_util.h"
#include "engine/pipeline/photo_progress.h"
#include "engine/pipeline/photo_structure.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr int kW = RoomCapture::kWidth, kH = RoomCapture::kHeight;

// What a sensor gives in the dark: noise about black, of which one half is cut off.
ImageU8 CapOn(int seed) {
  ImageU8 image(kW, kH);
  const CounterRng rng(seed, 1);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<uint8_t>(std::clamp(1.2 * rng.Normal(i), 0.0, 255.0));
  }
  return image;
}

std::vector<std::string> LeftOut(const PhotoScreen& screen) {
  std::vector<std::string> names;
  for (const PhotoLeftOut& photo : screen.left_out) names.push_back(photo.name);
  return names;
}

absl::StatusOr<PhotoScreen> Screen(const ReconstructInput& input) {
  return ScreenPhotos(CutInput(input), 1, CancelToken());
}

TEST(PhotoScreen, LeavesAGoodCaptureAlone) {
  RoomCapture capture(8);
  for (const Light light : {Light::kLow, Light::kNormal, Light::kOver}) {
    capture.SetLight([&](int) { return light; });
    const auto screen = Screen(capture.Input("work"));
    ASSERT_TRUE(screen.ok()) << screen.status();
    EXPECT_EQ(screen->photos.size(), 8u);
    EXPECT_THAT(screen->notes, IsEmpty());
    EXPECT_THAT(screen->masks, IsEmpty());
    for (const ScreenedPhoto& photo : screen->photos) EXPECT_GT(photo.structure, 2 * kNoStructure);
  }
}

// A time that the camera writes into every photo, or an arm of the robot.
TEST(PhotoScreen, WhatIsMaskedDoesNotMakeAPhotoOfALensCap) {
  const RoomCapture capture(8);
  ImageU8 stamped = CapOn(1);
  PlaneU8 mask(kW, kH);
  std::fill(mask.data.begin(), mask.data.end(), kCounts);
  for (int y = kH - 12; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      std::fill_n(stamped.pixel(x, y), 3, x / 4 % 2 == 0 ? 250 : 10);
      mask.data[size_t(y) * kW + x] = 0;
    }
  }
  capture.SetPhoto(2, stamped);
  ReconstructInput input = capture.Input("work");
  ASSERT_EQ(Screen(input)->photos.size(), 8u) << "the stamp is structure";
  input.masks_dir = capture.Path("masks");
  fs::create_directory(input.masks_dir);
  ASSERT_TRUE(WriteFileAtomically(input.masks_dir + "/v002.png", EncodeMask(mask).value()).ok());
  EXPECT_THAT(LeftOut(*Screen(input)), ElementsAre("v002.png"));
}

TEST(PhotoScreen, ALensCapIsLeftOutByName) {
  const RoomCapture capture(8);
  capture.SetPhoto(2, CapOn(1));
  capture.SetPhoto(5, CapOn(2));
  const auto report = Train(capture.Input("work"), capture.Options(10));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->registered, 6);
  EXPECT_EQ(report->photos, 8);
  EXPECT_THAT(report->dropped, ElementsAre("v002.png", "v005.png"));
  EXPECT_THAT(report->notes, Contains(HasSubstr("v002.png is left out: it shows nothing but")));
}

// A pocket, and a cap whose noise shows.
TEST(PhotoScreen, APhotoOfOneColourIsLeftOutAlsoWhereMostAre) {
  const RoomCapture capture(14);
  for (int i = 0; i < 7; ++i) capture.SetPhoto(i, ImageU8(kW, kH));
  capture.SetPhoto(7, CapOn(1));
  const auto screen = Screen(capture.Input("work"));
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_EQ(screen->photos.size(), 6u);
  ASSERT_EQ(screen->left_out.size(), 8u);
  EXPECT_EQ(screen->left_out[0].why, "is of one colour, (0, 0, 0)");
  EXPECT_THAT(screen->left_out[7].why, HasSubstr("nothing but noise"));
}

// Of a camera that sees by infrared light at night.
TEST(PhotoScreen, GreyPhotosAmongOthersAreNamed) {
  const RoomCapture capture(4);
  for (int i = 3; i >= 0; --i) {
    ImageU8 photo = capture.Photo(i, Light::kNormal);
    for (size_t k = 0; k < photo.data.size(); k += 3)
      photo.data[k] = photo.data[k + 2] = photo.data[k + 1];
    capture.SetPhoto(i, photo);
    const auto screen = Screen(capture.Input("work"));
    ASSERT_TRUE(screen.ok()) << screen.status();
    EXPECT_EQ(screen->photos.size(), 4u);
    if (i == 0) {
      EXPECT_THAT(screen->notes, IsEmpty());
    } else {
      EXPECT_THAT(screen->notes, ElementsAre(HasSubstr(absl::StrCat(4 - i, " of 4 photos ha"))));
      EXPECT_THAT(screen->notes[0], HasSubstr(RoomCapture::Name(i)));
    }
  }
}

TEST(PhotoScreen, AMapOfShadingThatIsNotAppliedIsNoted) {
  const RoomCapture capture(4);
  SensorFrame frame;
  frame.width = kW;
  frame.height = kH;
  frame.has_gain_map = true;
  for (int i = 0; i < kW * kH; ++i) {
    frame.numbers.push_back(static_cast<uint16_t>(20000 + 500 * (i % kW)));
  }
  const std::string path = capture.Path("images/v001.png");
  ASSERT_TRUE(WriteFileAtomically(path, EncodeDng(frame)).ok());
  const auto screen = Screen(capture.Input("work"));
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_THAT(screen->notes, ElementsAre(HasSubstr("GainMap) of 1 photo, such as v001.png, is")));
}

TEST(PhotoScreen, UnreadablePhotosAreLeftOutWhileEnoughRemain) {
  const RoomCapture capture(6);
  const auto write = [&](int i, const std::string& bytes) {
    ASSERT_TRUE(WriteFileAtomically(capture.Path("images/" + RoomCapture::Name(i)), bytes).ok());
  };
  const auto whole = ReadFile(capture.Path("images/v001.png"), "", 1 << 20);
  ASSERT_TRUE(whole.ok());
  write(1, whole->substr(0, whole->size() * 4 / 5));
  write(3, "GIF89a, not a PNG");
  const auto report = Train(capture.Input("work"), capture.Options(10));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->registered, 4);
  EXPECT_THAT(report->dropped, ElementsAre("v001.png", "v003.png"));
  EXPECT_THAT(report->notes, Contains(HasSubstr("v001.png is left out")));
  EXPECT_THAT(report->notes, Contains(HasSubstr("v003.png is left out")));

  write(0, "");
  write(2, "x");
  const absl::Status status = Train(capture.Input("work2"), capture.Options(10)).status();
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
  EXPECT_THAT(std::string(status.message()), HasSubstr("v000.png"));
}

TEST(PhotoScreen, AJpegWithoutItsEndMarkIsReadWithANote) {
  const RoomCapture capture(4);
  const auto jpeg = EncodeJpeg(capture.Photo(1, Light::kNormal));
  ASSERT_TRUE(jpeg.ok());
  const std::string path = capture.Path("images/v001.png");
  ASSERT_TRUE(WriteFileAtomically(path, jpeg->substr(0, jpeg->size() - 2)).ok());
  const auto screen = Screen(capture.Input("work"));
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_THAT(screen->left_out, IsEmpty());
  EXPECT_THAT(screen->notes, ElementsAre(HasSubstr("v001.png ends without its end mark")));
  // The pixels themselves must all be there.
  for (const size_t missing : {10, 200}) {
    ASSERT_TRUE(WriteFileAtomically(path, jpeg->substr(0, jpeg->size() - missing)).ok());
    const auto cut = Screen(capture.Input("work"));
    ASSERT_TRUE(cut.ok());
    EXPECT_THAT(LeftOut(*cut), ElementsAre("v001.png")) << missing;
  }
}

TEST(PhotoScreen, BarsOfAllPhotosAreMasked) {
  const RoomCapture capture(5);
  const auto with_bars = [&](int i, int bar, Light light = Light::kLow) {
    ImageU8 photo = capture.Photo(i, light);
    for (int y = 0; y < kH; ++y) {
      if (y < bar || y >= kH - bar) std::fill_n(photo.pixel(0, y), 3 * kW, 0);
    }
    return photo;
  };
  for (int i = 0; i < 5; ++i) capture.SetPhoto(i, with_bars(i, 7));
  const auto screen = Screen(capture.Input("work"));
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_THAT(screen->notes, ElementsAre(HasSubstr("rows 0 to 6 and 41 to 47 are black in all 5")));
  ASSERT_EQ(screen->masks.size(), 5u);
  const auto read =
      ReadMaskedPhoto(capture.Path("images/v002.png"), "v002.png", screen->masks.at("v002.png"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(std::count(read->mask.data.begin(), read->mask.data.end(), 255), (kH - 14) * kW);

  // Of a video, which compresses in blocks.
  for (int i = 0; i < 5; ++i) {
    capture.SetPhoto(i, with_bars(i, 7, Light::kNormal));
    const std::string path = capture.Path(absl::StrCat("images/v00", i, ".png"));
    const std::string frame = EncodePng16(ReadPhoto(path, "photo").value(), 8).value();
    ASSERT_TRUE(WriteFileAtomically(path, frame).ok());
  }
  const auto of_video = Screen(capture.Input("work"));
  ASSERT_TRUE(of_video.ok()) << of_video.status();
  EXPECT_THAT(of_video->notes,
              ElementsAre(ContainsRegex("rows 0 to (7|15) and (32|40) to 47 are")));
  for (int i = 0; i < 5; ++i) capture.SetPhoto(i, with_bars(i, 7));

  // One photo without them, and they are none.
  capture.SetPhoto(3, capture.Photo(3, Light::kLow));
  const auto other = Screen(capture.Input("work"));
  ASSERT_TRUE(other.ok());
  EXPECT_THAT(other->notes, IsEmpty());
}

// PNG with an alpha channel that is 0 in the left `columns`.
void WriteWithAlpha(const std::string& path, const ImageU8& photo, int columns) {
  std::vector<uint8_t> rgba;
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      rgba.insert(rgba.end(), photo.pixel(x, y), photo.pixel(x, y) + 3);
      rgba.push_back(x < columns ? 0 : 255);
    }
  }
  const auto png = EncodePngCodes(rgba.data(), photo.width, photo.height, 4);
  ASSERT_TRUE(png.ok() && WriteFileAtomically(path, *png).ok());
}

TEST(PhotoProgress, IsReportedByTheCallersThread) {
  std::vector<std::string> lines;
  const auto caller = std::this_thread::get_id();
  PhotoProgress progress(
      [&](const std::string& line) {
        EXPECT_EQ(std::this_thread::get_id(), caller);
        lines.push_back(line);
      },
      "reading photos", 100, /*seconds=*/0);
  ParallelFor(1, 50, [&](size_t, int thread) { progress.Done(thread); });
  ASSERT_EQ(lines.size(), 50u);
  EXPECT_EQ(lines[11], "reading photos: 12 of 100");
  ParallelFor(2, 50, [&](size_t, int thread) { progress.Done(thread); });
}

TEST(PhotoScreen, TransparencyIsAMaskJoinedWithTheGivenOne) {
  const RoomCapture capture(4);
  WriteWithAlpha(capture.Path("images/v001.png"), capture.Photo(1, Light::kLow), 10);
  WriteWithAlpha(capture.Path("images/v002.png"), capture.Photo(2, Light::kLow), 0);
  ReconstructInput input = capture.Input("work");
  input.masks_dir = capture.Path("masks");
  fs::create_directory(input.masks_dir);
  PlaneU8 given(kW, kH);
  std::fill(given.data.begin() + kW, given.data.end(), 255);  // all but the first row
  const auto png = EncodeMask(given);
  ASSERT_TRUE(png.ok());
  ASSERT_TRUE(WriteFileAtomically(input.masks_dir + "/v001_mask.png", *png).ok());
  const auto screen = Screen(input);
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_EQ(screen->masks.size(), 1u);
  const auto read =
      ReadMaskedPhoto(capture.Path("images/v001.png"), "v001.png", screen->masks.at("v001.png"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(std::count(read->mask.data.begin(), read->mask.data.end(), 255), (kH - 1) * (kW - 10));
}

TEST(PhotoScreen, NamesThatModelsOfCamerasCannotHoldAreLeftOut) {
  const RoomCapture capture(5);
  fs::rename(capture.Path("images/v001.png"), capture.Path("images/K\xFC"
                                                           "che.png"));
  fs::rename(capture.Path("images/v002.png"), capture.Path("images/low\\2.png"));
  const auto screen = Screen(capture.Input("work"));
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_EQ(screen->photos.size(), 3u);
  EXPECT_THAT(screen->notes, Contains(HasSubstr("is not valid UTF-8")));
  EXPECT_THAT(screen->notes, Contains(HasSubstr("holds a path separator")));
}

TEST(PhotoScreen, MasksThatTheCamerasNameAreUsed) {
  const RoomCapture capture(4);
  ReconstructInput input = capture.Input("work");
  input.cameras_path = capture.Path("transforms.json");
  std::string json = FormatTransforms(capture.model, "images");
  const auto name_mask = [&](int i, const std::string& path) {
    const std::string photo = "\"images/" + RoomCapture::Name(i) + "\"";
    json.replace(json.find(photo), photo.size(), photo + ", \"mask_path\": \"" + path + "\"");
  };
  name_mask(0, "m/a.png");
  name_mask(1, "m/gone.png");
  name_mask(2, "../" + fs::path(capture.Path("x")).parent_path().filename().string() + "/m/a.png");
  ASSERT_TRUE(WriteFileAtomically(input.cameras_path, json).ok());
  fs::create_directory(capture.Path("m"));
  PlaneU8 mask(kW, kH);
  std::fill_n(mask.data.begin(), mask.data.size() / 2, kCounts);
  const auto png = EncodeMask(mask);
  ASSERT_TRUE(png.ok());
  ASSERT_TRUE(WriteFileAtomically(capture.Path("m/a.png"), *png).ok());
  const auto screen = Screen(input);
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_EQ(screen->masks.size(), 1u);  // none from above the file's folder
  EXPECT_EQ(screen->masks.at("v000.png"), capture.Path("m/a.png"));
  EXPECT_THAT(screen->notes, Contains(HasSubstr("masks of 2 photos that are not there")));
}

// As nerfstudio has them; sent to a service, they lie in another folder.
TEST(PhotoScreen, MasksThatTheCamerasNameMayLieAmongOtherMasks) {
  const RoomCapture capture(4);
  ReconstructInput input = capture.Input("work");
  input.cameras_path = capture.Path("transforms.json");
  input.masks_dir = capture.Path("masks");
  fs::create_directory(input.masks_dir);
  PlaneU8 mask(kW, kH);
  mask.data[5] = 255;
  const auto png = EncodeMask(mask);
  ASSERT_TRUE(png.ok());
  for (const char* name : {"m1.png", "m2.png", "v002.png", "left_out.png"}) {
    ASSERT_TRUE(WriteFileAtomically(input.masks_dir + "/" + name, *png).ok());
  }
  const auto frame = [](const std::string& photo, const std::string& path) {
    return "{\"file_path\": \"images/" + photo + "\", \"mask_path\": \"" + path + "\"}";
  };
  ASSERT_TRUE(
      WriteFileAtomically(input.cameras_path, "{\"frames\": [" + frame("v000.png", "masks/m1.png") +
                                                  "," + frame("v001.png", "other/folder/m2.png") +
                                                  "," + frame("v002.png", "other/gone.png") + "," +
                                                  frame("gone.png", "masks/left_out.png") + "]}")
          .ok());
  const auto list = ListPhotosAndMasks(input);
  ASSERT_TRUE(list.ok()) << list.status();
  EXPECT_EQ(list->masks, (MaskPaths{{"v000.png", input.masks_dir + "/m1.png"},
                                    {"v001.png", input.masks_dir + "/m2.png"},
                                    {"v002.png", input.masks_dir + "/v002.png"}}));
  EXPECT_THAT(list->notes, ElementsAre(HasSubstr("2 masks are those that the cameras' file")));
  ASSERT_TRUE(WriteFileAtomically(input.masks_dir + "/m3.png", *png).ok());
  EXPECT_EQ(Reason(ListPhotosAndMasks(input).status()), "MASK_WITHOUT_PHOTO");
}

TEST(PhotoScreen, MasksThatTheCamerasNameLieBesideAFileNamedWithoutItsFolder) {
  const RoomCapture capture(4);
  ReconstructInput input = capture.Input("work");
  input.cameras_path = "transforms.json";
  ASSERT_TRUE(WriteFileAtomically(
                  capture.Path("transforms.json"),
                  R"({"frames": [{"file_path": "images/v000.png", "mask_path": "m/a.png"}]})")
                  .ok());
  fs::create_directory(capture.Path("m"));
  ASSERT_TRUE(WriteFileAtomically(capture.Path("m/a.png"), "a mask").ok());
  const fs::path before = fs::current_path();
  fs::current_path(capture.Path(""));
  const auto list = ListPhotosAndMasks(input);
  fs::current_path(before);
  ASSERT_TRUE(list.ok()) << list.status();
  ASSERT_EQ(list->masks.count("v000.png"), 1u);
  EXPECT_EQ(Bytes(list->masks.at("v000.png")), "a mask");
}

// The visible and the thermal camera of a rig have photos of one stem; one camera's are sent.
TEST(PhotoScreen, MasksThatTheCamerasNameAreOfTheirOwnPhotosOnly) {
  const RoomCapture capture(4);
  ReconstructInput input = capture.Input("work");
  input.cameras_path = capture.Path("transforms.json");
  ASSERT_TRUE(
      WriteFileAtomically(
          input.cameras_path,
          R"({"frames": [{"file_path": "rgb/v000.jpg", "mask_path": "m/a.png"},)"
          R"({"file_path": "thermal/v000.png"}, {"file_path": "v001", "mask_path": "m/a.png"}]})")
          .ok());
  fs::create_directory(capture.Path("m"));
  ASSERT_TRUE(WriteFileAtomically(capture.Path("m/a.png"), "a mask").ok());
  const auto list = ListPhotosAndMasks(input);
  ASSERT_TRUE(list.ok()) << list.status();
  EXPECT_EQ(list->masks, (MaskPaths{{"v001.png", capture.Path("m/a.png")}}));
  EXPECT_THAT(list->notes, ElementsAre(HasSubstr("1 mask is that that the cameras' file")));
}

TEST(PhotoScreen, MasksBesideThePhotosAreNoPhotos) {
  const RoomCapture capture(4);
  ImageU8 moving(kW, kH);
  std::fill_n(moving.pixel(3, 3), 3, 255);
  ASSERT_TRUE(WritePng(capture.Path("images/dynamic_mask_v000.png"), moving).ok());
  std::fill(moving.data.begin(), moving.data.end(), 255);
  std::fill_n(moving.pixel(8, 8), 3, 0);
  ASSERT_TRUE(WritePng(capture.Path("images/v001_mask.png"), moving).ok());
  const auto screen = Screen(capture.Input("work"));
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_EQ(screen->photos.size(), 4u);
  EXPECT_THAT(screen->left_out, IsEmpty());
  EXPECT_THAT(screen->notes, ElementsAre(HasSubstr("2 files among the photos, such as v001_mask")));
  for (const int i : {0, 1}) {
    const std::string name = RoomCapture::Name(i);
    const auto read = ReadMaskedPhoto(capture.Path("images/" + name), name, screen->masks.at(name));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(std::count(read->mask.data.begin(), read->mask.data.end(), 0), 1) << name;
  }
}

TEST(PhotoScreen, TheSamePhotoTwiceIsLearntOnce) {
  const RoomCapture capture(6);
  capture.SetPhoto(4, capture.Photo(2, Light::kLow));
  // Before the original by name, and without a camera.
  fs::copy_file(capture.Path("images/v003.png"), capture.Path("images/v003 (1).png"));
  const auto report = Train(capture.Input("work"), capture.Options(10));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains("v004.png is left out: it is the same photo as v002.png"));
  EXPECT_THAT(report->notes,
              Contains("v003 (1).png is left out: it is the same photo as v003.png"));
  EXPECT_EQ(report->registered, 5);
}

TEST(PhotoScreen, OfTheSamePhotoTwiceTheOneThatCamerasNameIsLearnt) {
  const RoomCapture capture(6);
  for (int i = 0; i < 6; ++i) {
    fs::copy_file(capture.Path("images/" + RoomCapture::Name(i)),
                  capture.Path(absl::StrCat("images/", i, ".png")));
  }
  ReconstructInput input = capture.Input("work");
  const auto report = Train(input, capture.Options(10));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->registered, 6);
  EXPECT_THAT(report->notes, Contains("3.png is left out: it is the same photo as v003.png"));
  // Cameras are searched for: the shortest name, unless a depth map has another.
  input.cameras_path.clear();
  input.depth_dir = capture.Path("depth");
  fs::create_directory(input.depth_dir);
  ASSERT_TRUE(WritePfm(input.depth_dir + "/v002.pfm", capture.Depth(2)).ok());
  const auto screen = Screen(input);
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_THAT(screen->Names(),
              ElementsAre("0.png", "1.png", "3.png", "4.png", "5.png", "v002.png"));
}

TEST(PhotoScreen, AFarCameraIsNamedAndMovesNoOrbit) {
  RoomCapture capture(9);
  ASSERT_TRUE(Train(capture.Input("near"), capture.Options(10)).ok());
  const auto near = MakeEngine()->LoadScene(capture.Path("near/scene.litags"));
  ASSERT_TRUE(near.ok()) << near.status();
  capture.model.views[6].camera.t[0] += 500;
  const auto report = Train(capture.Input("far"), capture.Options(10));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("the camera of v006.png stands far")));
  const auto far = MakeEngine()->LoadScene(report->scene_path);
  ASSERT_TRUE(far.ok()) << far.status();
  EXPECT_LT((*far)->radius(), 2 * (*near)->radius());
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR((*far)->center()[k], (*near)->center()[k], (*near)->radius());
  }
}

}  // namespace
}  // namespace litags
