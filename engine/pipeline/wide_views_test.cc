#include "engine/pipeline/wide_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/cameras_io.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/png_codes.h"
#include "engine/pipeline/photo_look.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/pipeline/wide_photos.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;

// A panorama in colours of all directions.
ImageU8 Around(int width) {
  ImageU8 image(width, width / 2);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double right = 2 * std::numbers::pi * x / width;
      image.pixel(x, y)[0] = static_cast<uint8_t>(60 + 50 * std::sin(right) + y / 8);
      image.pixel(x, y)[1] = static_cast<uint8_t>(60 + 50 * std::cos(right));
      image.pixel(x, y)[2] = static_cast<uint8_t>(60 + 50 * std::sin(2 * right) - y / 8);
    }
  }
  return image;
}

class WideViews : public ::testing::Test {
 protected:
  WideViews() {
    for (const char* name : {"photos", "covers", "work"}) fs::create_directory(dir_ / name);
    input_.images_dir = dir_ / "photos";
    input_.work_dir = dir_ / "work";
    for (const char* name : {"a", "d", "e"}) {
      Write(absl::StrCat("photos/", name, ".png"), Around(256));
    }
    Write("photos/b.png", ImageU8(300, 150));  // of their shape
    Write("photos/c.png", ImageU8(200, 150));
  }

  void Write(const std::string& name, const ImageU8& image) {
    ASSERT_TRUE(WritePng(dir_ / name, image).ok());
  }

  absl::StatusOr<CutInput> Cut() {
    return WithViewsOfWidePhotos(
        input_, 2, CancelToken(), [](const std::string&) {}, &notes_);
  }

  const TempDir dir_;
  CutInput input_;
  std::vector<std::string> notes_;
};

TEST_F(WideViews, StandForThePanoramaBesideOtherPhotos) {
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  const auto names = ListPhotos(cut->images_dir, "images");
  ASSERT_TRUE(names.ok()) << names.status();
  EXPECT_EQ(names->size(), 3u * 6 + 2);
  EXPECT_THAT(*names, IsSupersetOf({"a_back.png", "a_down.png", "a_front.png", "a_left.png",
                                    "a_right.png", "a_up.png", "b.png", "c.png", "e_up.png"}));
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("a.png: 6 views")));
  EXPECT_EQ(cut->rig_views.size(), 18u);
  EXPECT_EQ(cut->rig_views.at("a_up.png").focal_length, 41);
  EXPECT_EQ(cut->rig_views.at("a_up.png").rig, "a.png");
  const auto left = ReadPhoto(cut->images_dir + "/a_left.png", "photo");
  ASSERT_TRUE(left.ok()) << left.status();
  EXPECT_NEAR(left->pixel(41, 41)[1] / kPhotoCode, 60, 2);  // a quarter from the left edge
  EXPECT_NEAR(left->pixel(41, 41)[0] / kPhotoCode, 60 + 50 + 8, 2);
}

TEST_F(WideViews, SayWhatTheFileTheyAreCutFromSays) {
  const std::string jpeg = EncodeJpeg(Around(256)).value();
  ASSERT_TRUE(WriteFileAtomically(dir_ / "photos/j.jpg", jpeg).ok());
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  const RigView& source = cut->rig_views.at("j_up.png");
  EXPECT_EQ(source.chroma_step, ReadImageInfo(jpeg, "f")->chroma_step);
  EXPECT_GT(source.chroma_step, 0);
}

TEST_F(WideViews, MasksGoWithThem) {
  ImageU8 tripod(256, 128), all(200, 150);
  std::fill_n(tripod.data.begin(), size_t{3} * 256 * 100, 255);
  std::fill(all.data.begin(), all.data.end(), 255);
  Write("covers/a.png", tripod);
  Write("covers/c.png.png", all);
  input_.masks_dir = dir_ / "covers";
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  const auto names = ListPhotos(cut->images_dir, "images");
  ASSERT_TRUE(names.ok()) << names.status();
  const auto masks = FindMasks(cut->masks_dir, *names);
  ASSERT_TRUE(masks.ok()) << masks.status();
  EXPECT_EQ(masks->size(), 2u);  // none where all of a view counts
  const auto down = ReadImage(masks->at("a_down.png"), "mask");
  ASSERT_TRUE(down.ok()) << down.status();
  EXPECT_EQ(down->pixel(41, 41)[0], 0);
  EXPECT_EQ(down->pixel(0, 0)[0], 255);
  EXPECT_TRUE(masks->contains("c.png"));

  ImageU8 half(128, 64);  // of the panorama's shape
  std::fill(half.data.begin(), half.data.end(), 255);
  Write("covers/a.png", half);
  EXPECT_EQ(GetErrorDetail(Cut().status())->reason, "MASK_SIZE");
}

TEST_F(WideViews, OfPhotosOfOneStemHaveNamesOfTheirOwn) {
  Write("photos/a.PNG", Around(256));
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->rig_views.size(), 4u * 6);
  EXPECT_TRUE(cut->rig_views.contains("a.png_up.png"));
  EXPECT_TRUE(cut->rig_views.contains("a.PNG_up.png"));
  EXPECT_TRUE(cut->rig_views.contains("d_up.png"));
}

TEST_F(WideViews, DoNotReplaceAPhotoThatIsNamedAsOneOfThem) {
  Write("photos/d_up.png", ImageU8(200, 150));
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(ReadImageSize(cut->images_dir + "/d_up.png", "photo")->width, 200);
  EXPECT_TRUE(cut->rig_views.contains("d.png_up.png"));
  EXPECT_TRUE(cut->rig_views.contains("a_up.png"));
}

// The edges of the others tell, so it need not be decoded to be taken for a panorama.
TEST_F(WideViews, AreNotMadeOfADamagedPanorama) {
  const std::string jpeg = EncodeJpeg(Around(256)).value();
  ASSERT_TRUE(WriteFileAtomically(dir_ / "photos/j.jpg", jpeg.substr(0, jpeg.size() / 2)).ok());
  ASSERT_FALSE(ReadPhoto(dir_ / "photos/j.jpg", "photo").ok());
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->rig_views.size(), 18u);
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("3 photos are panoramas")));
  const auto screen = ScreenPhotos(*cut, 2, CancelToken());
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_THAT(screen->notes, Contains(HasSubstr("j.jpg is left out: ")));
}

TEST_F(WideViews, AreNotMadeOfOtherPhotos) {
  // Two of which the edges meet may be chance.
  fs::remove(dir_ / "photos/a.png");
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->images_dir, input_.images_dir);
  EXPECT_TRUE(notes_.empty());
  EXPECT_FALSE(fs::exists(dir_ / "work/wide_views"));
}

TEST_F(WideViews, MasksBesideAPanoramaAreNoPhotos) {
  ImageU8 tripod(256, 128);
  std::fill_n(tripod.data.begin(), size_t{3} * 256 * 100, 255);
  Write("photos/a_mask.png", tripod);
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(ListPhotos(cut->images_dir, "images")->size(), 3u * 6 + 2);
  EXPECT_TRUE(fs::exists(cut->masks_dir + "/a_down.png"));
}

TEST_F(WideViews, MasksOfAllPanoramasDoNotHideThem) {
  ImageU8 tripod(256, 128);
  std::fill_n(tripod.data.begin(), size_t{3} * 256 * 100, 255);
  fs::remove(dir_ / "photos/b.png");
  fs::remove(dir_ / "photos/c.png");
  for (const char* name : {"a", "d", "e"}) {
    Write(absl::StrCat("photos/", name, "_mask.png"), tripod);
  }
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->rig_views.size(), 18u);
}

TEST_F(WideViews, TransparencyGoesWithThem) {
  const ImageU8 around = Around(256);
  std::vector<uint8_t> rgba;
  for (int y = 0; y < 128; ++y) {
    for (int x = 0; x < 256; ++x) {
      rgba.insert(rgba.end(), around.pixel(x, y), around.pixel(x, y) + 3);
      rgba.push_back(y < 100 ? 255 : 0);
    }
  }
  const std::string png = EncodePngCodes(rgba.data(), 256, 128, 4).value();
  ASSERT_TRUE(WriteFileAtomically(dir_ / "photos/a.png", png).ok());
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  const auto down = ReadImage(cut->masks_dir + "/a_down.png", "mask");
  ASSERT_TRUE(down.ok()) << down.status();
  EXPECT_EQ(down->pixel(41, 41)[0], 0);
  EXPECT_EQ(down->pixel(0, 0)[0], 255);
}

// Fisheyes that are solved among panoramas' views.
TEST_F(WideViews, AreCutAgainWithoutLosingThoseThatWereCut) {
  const auto first = Cut();
  ASSERT_TRUE(first.ok()) << first.status();
  CutInput solved = *first;
  solved.cameras_path = dir_ / "fisheye.json";
  ASSERT_TRUE(WriteFileAtomically(solved.cameras_path, R"({"camera_model": "OPENCV_FISHEYE",
      "fl_x": 60, "fl_y": 60, "cx": 100, "cy": 75, "w": 200, "h": 150, "frames": [
      {"file_path": "c.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})")
                  .ok());
  const auto again = WithViewsOfWidePhotos(
      solved, 2, CancelToken(), [](const std::string&) {}, &notes_);
  ASSERT_TRUE(again.ok()) << again.status();
  const auto names = ListPhotos(again->images_dir, "images");
  ASSERT_TRUE(names.ok()) << names.status();
  EXPECT_THAT(*names, IsSupersetOf({"a_back.png", "b.png", "c_front.png"}));
  EXPECT_TRUE(again->rig_views.contains("a_back.png"));
  EXPECT_TRUE(again->rig_views.contains("c_front.png"));
  EXPECT_TRUE(ReadPhoto(again->images_dir + "/a_back.png", "photo").ok());
}

TEST_F(WideViews, OfWhichAMaskLeavesNothingAreNotMade) {
  ImageU8 upper(256, 128);
  std::fill_n(upper.data.begin(), size_t{3} * 256 * 60, 255);
  Write("photos/a_mask.png", upper);
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_FALSE(cut->rig_views.contains("a_down.png"));
  EXPECT_TRUE(cut->rig_views.contains("a_front.png"));
  EXPECT_THAT(notes_, Contains(HasSubstr("a.png is a panorama: 5 views")));
  EXPECT_THAT(notes_, Contains(HasSubstr("such as d.png: 6 views of each")));
}

TEST_F(WideViews, OfAPanoramaThatAMaskHidesNearlyAllOfAreNotMade) {
  ImageU8 spot(256, 128);
  std::fill_n(spot.pixel(128, 64), 3 * 4, 255);
  Write("photos/a_mask.png", spot);
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->rig_views.size(), 2u * 6);
  EXPECT_THAT(notes_,
              ElementsAre(HasSubstr("among the photos"), HasSubstr("a.png is left out: its mask"),
                          HasSubstr("2 photos are panoramas")));
}

// As phones write of a strip around the horizon.
TEST_F(WideViews, OfAPartOfAPanoramaHideWhatItDoesNotShow) {
  const ImageU8 all = Around(256);
  ImageU8 strip(256, 32);
  std::copy_n(all.pixel(0, 48), strip.data.size(), strip.data.begin());
  const std::string part =
      "GPano:ProjectionType=\"equirectangular\" GPano:FullPanoWidthPixels=\"256\" "
      "GPano:FullPanoHeightPixels=\"128\" GPano:CroppedAreaImageWidthPixels=\"256\" "
      "GPano:CroppedAreaImageHeightPixels=\"32\" GPano:CroppedAreaLeftPixels=\"0\" "
      "GPano:CroppedAreaTopPixels=\"48\"";
  const std::string jpeg = WithJpegXmp(EncodeJpeg(strip).value(), part);
  ASSERT_TRUE(WriteFileAtomically(dir_ / "photos/s.jpg", jpeg).ok());
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_THAT(notes_, Contains(HasSubstr("s.jpg is a part of a panorama: 4 views")));
  EXPECT_FALSE(cut->rig_views.contains("s_up.png"));
  const auto mask = ReadImage(cut->masks_dir + "/s_left.png", "mask");
  ASSERT_TRUE(mask.ok()) << mask.status();
  EXPECT_EQ(mask->pixel(41, 41)[0], 255);
  EXPECT_EQ(mask->pixel(41, 20)[0], 0);  // 22.5 degrees is a tangent of 0.41
  EXPECT_EQ(mask->pixel(41, 26)[0], 255);
  const auto left = ReadPhoto(cut->images_dir + "/s_left.png", "photo");
  EXPECT_NEAR(left->pixel(41, 41)[1] / kPhotoCode, 60, 4);
}

// 22.5 degrees across.
TEST_F(WideViews, ASmallPartOfAPanoramaStaysAPhoto) {
  const std::string part =
      "GPano:ProjectionType=\"equirectangular\" GPano:FullPanoWidthPixels=\"3200\" "
      "GPano:FullPanoHeightPixels=\"1600\" GPano:CroppedAreaImageWidthPixels=\"200\" "
      "GPano:CroppedAreaImageHeightPixels=\"100\" GPano:CroppedAreaLeftPixels=\"1500\" "
      "GPano:CroppedAreaTopPixels=\"750\"";
  const std::string jpeg = WithJpegXmp(EncodeJpeg(ImageU8(200, 100)).value(), part);
  ASSERT_TRUE(WriteFileAtomically(dir_ / "photos/s.jpg", jpeg).ok());
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_THAT(*ListPhotos(cut->images_dir, "images"), Contains("s.jpg"));
}

// Cameras of all photos of the fixture, those that are panoramas at places of their own.
std::string GivenPanoramas() {
  std::string frames;
  for (const char* name : {"a", "d", "e"}) {
    // Turned by 90 degrees about the vertical axis: it looks along -x.
    absl::StrAppend(&frames, frames.empty() ? "" : ",", R"({"file_path": ")", name,
                    R"(.png", "camera_model": "EQUIRECTANGULAR", "fl_x": 128, "fl_y": 128,
                    "transform_matrix": [[0,0,1,)",
                    name[0] - 'a', R"(],[0,1,0,2],[-1,0,0,3],[0,0,0,1]]})");
  }
  return absl::StrCat(R"({"frames": [)", frames, R"(, {"file_path": "c.png", "fl_x": 100,
                      "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})");
}

TEST_F(WideViews, HaveTheGivenPlacesOfTheirPanoramas) {
  input_.cameras_path = dir_ / "transforms.json";
  ASSERT_TRUE(WriteFileAtomically(input_.cameras_path, GivenPanoramas()).ok());
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  const auto cameras = ReadCameras(cut->cameras_path, "cameras");
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_EQ(cameras->views.size(), 3u * 6 + 1);
  for (const View& view : cameras->views) {
    if (view.name[0] == 'c') continue;
    EXPECT_EQ(view.camera.fx, 41) << view.name;
    const auto center = view.camera.Center();
    EXPECT_NEAR(center[0], view.name[0] - 'a', 1e-9) << view.name;
    EXPECT_NEAR(center[1], 2, 1e-9) << view.name;
    EXPECT_NEAR(center[2], 3, 1e-9) << view.name;
  }
  const auto axis = [&](const std::string& name, size_t i) {  // the view's direction
    const auto view = std::find_if(cameras->views.begin(), cameras->views.end(),
                                   [&](const View& v) { return v.name == name; });
    return view == cameras->views.end() ? 0 : view->camera.R[6 + i];
  };
  EXPECT_NEAR(axis("d_front.png", 0), -1, 1e-9);
  EXPECT_NEAR(axis("d_up.png", 1), 1, 1e-9);
  EXPECT_NEAR(axis("d_right.png", 2), -1, 1e-9);
}

TEST_F(WideViews, APanoramaOfOtherSidesIsNoneOfTheWholeSphere) {
  Write("photos/a.png", litags::Cut(Around(256), {0, 0, 256, 100}));
  input_.cameras_path = dir_ / "transforms.json";
  ASSERT_TRUE(WriteFileAtomically(input_.cameras_path, GivenPanoramas()).ok());
  const auto cut = Cut();
  ASSERT_FALSE(cut.ok());
  EXPECT_EQ(GetErrorDetail(cut.status())->reason, "CAMERA_SIZE_MISMATCH");
}

// A fisheye of 180 degrees across 200 px, which sees grey; black around.
Photo Round(int noise) {
  Photo photo(240, 200);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 240; ++x) {
      const bool in = std::hypot(x + 0.5 - 120, y + 0.5 - 100) < 90;
      for (int c = 0; c < 3; ++c) {
        photo.pixel(x, y)[c] = static_cast<int16_t>(
            kPhotoCode * (1 + (in ? 9 + noise * ((x * 7 + y * 13) % 5) : (x + y) % 2)));
      }
    }
  }
  return photo;
}

TEST(DescribeWidePhotos, OneIsNamedAndSeveralAreCounted) {
  std::vector<WidePhoto> photos(3);
  photos[0] = {.name = "a.jpg", .kind = "fisheye", .views = std::vector<CubeView>(5)};
  photos[1] = {.name = "b.jpg", .kind = "panorama", .views = std::vector<CubeView>(6)};
  photos[2] = {.name = "c.jpg", .kind = "panorama", .views = std::vector<CubeView>(6)};
  EXPECT_THAT(DescribeWidePhotos(photos),
              testing::ElementsAre("a.jpg is a fisheye: 5 views of it are the photos",
                                   "2 photos are panoramas of the whole sphere, such as b.jpg: 6 "
                                   "views of each are the photos"));
  // Of the others a mask leaves nothing.
  photos[0].views.resize(1);
  EXPECT_THAT(DescribeWidePhotos(photos),
              testing::Contains("a.jpg is a fisheye: 1 view of it is a photo"));
}

double FindCircle(const std::vector<Photo>& photos, const Camera& camera) {
  return litags::FindCircle(
      photos.size(), [&](size_t i) { return std::optional(photos[i]); }, camera);
}

TEST(FindCircle, IsWhereThePictureOfADarkFisheyeEnds) {
  const Camera camera = {.width = 240, .height = 200, .fx = 64, .fy = 64, .cx = 120, .cy = 100};
  EXPECT_NEAR(FindCircle({Round(0), Round(3)}, camera), 90, 2);
  EXPECT_TRUE(std::isinf(FindCircle({}, camera)));
  Photo lit = Round(0);
  for (int16_t& sample : lit.data) sample = static_cast<int16_t>(sample + 60 * kPhotoCode);
  EXPECT_TRUE(std::isinf(FindCircle({lit}, camera)));  // no black
  Photo whole(240, 200);
  for (size_t i = 0; i < whole.data.size(); ++i) {
    whole.data[i] = static_cast<int16_t>(i / 3 * 31 % 9 * kPhotoCode);
  }
  EXPECT_TRUE(std::isinf(FindCircle({whole}, camera)));  // a picture up to its corners
}

constexpr Camera kFisheye = {.width = 240, .height = 200, .fx = 64, .fy = 64, .cx = 120, .cy = 100};

// Of one code, for every sample.
std::vector<double> NoiseOf(uint64_t seed) {
  const CounterRng rng(seed, 0);
  std::vector<double> noise(3 * 240 * 200);
  for (size_t i = 0; i < noise.size(); ++i) noise[i] = rng.Normal(i);
  return noise;
}

// Light of `center` codes that falls off to a `fall`th in the corners, up to `radius` px from the
// centre, with noise, cut off at 0 as cameras do.
Photo Noisy(double center, double fall, double radius, const std::vector<double>& noise) {
  Photo photo(kFisheye.width, kFisheye.height);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const double from_center = std::hypot(x + 0.5 - kFisheye.cx, y + 0.5 - kFisheye.cy);
      const double share = from_center / std::hypot(kFisheye.cx, kFisheye.cy);
      const double lit = center * (1 - (1 - 1 / fall) * share * share);
      for (int c = 0; c < 3; ++c) {
        const size_t i = 3 * (static_cast<size_t>(y) * photo.width + x) + c;
        const double code = std::round(std::max((from_center < radius ? lit : 0) + noise[i], 0.0));
        photo.data[i] = static_cast<int16_t>(code * kPhotoCode);
      }
    }
  }
  return photo;
}

TEST(FindCircle, NoiseAndFallingLightOfADarkPhotoAreNoCircle) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const std::vector<double> one = NoiseOf(2 * seed), other = NoiseOf(2 * seed + 1);
    for (const double center : {0.5, 1.0, 2.0, 4.0, 20.0}) {
      for (const double fall : {1, 4, 20}) {
        const double found = FindCircle(
            {Noisy(center, fall, INFINITY, one), Noisy(center, fall, INFINITY, other)}, kFisheye);
        EXPECT_TRUE(std::isinf(found))
            << found << " px, " << center << " codes falling to 1 / " << fall << ", seed " << seed;
      }
    }
  }
}

TEST(FindCircle, ItIsFoundInPhotosAsDarkAsTheirNoise) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const std::vector<double> noise = NoiseOf(seed);
    for (const double center : {3.0, 60.0}) {
      EXPECT_NEAR(FindCircle({Noisy(center, 4, 90, noise)}, kFisheye), 90, 2)
          << center << " codes, seed " << seed;
    }
  }
}

// A light in the lens, 2 codes at the edge and weaker farther out.
TEST(FindCircle, LightOfTheLensBeyondTheEdgeIsNotOfTheCircle) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    Photo photo = Noisy(60, 2, 90, NoiseOf(seed));
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) {
        const double beyond = std::hypot(x + 0.5 - kFisheye.cx, y + 0.5 - kFisheye.cy) - 90;
        for (int c = 0; beyond > 0 && c < 3; ++c) {
          photo.pixel(x, y)[c] += static_cast<int16_t>(2 * std::exp(-beyond / 15) * kPhotoCode);
        }
      }
    }
    EXPECT_NEAR(FindCircle({photo}, kFisheye), 90, 2) << "seed " << seed;
  }
}

TEST(WhyLeftOut, AStripAmongPhotosIsNamed) {
  std::vector<ScreenedPhoto> photos(3);
  for (size_t i = 0; i < 3; ++i) {
    photos[i].name = absl::StrCat(i);
    photos[i].width = 400;
    photos[i].height = 300;
    photos[i].light = photos[i].structure = 1;
  }
  photos[1].width = 900;
  EXPECT_THAT(WhyLeftOut(photos), ElementsAre("", HasSubstr("strip of 900x300"), ""));
  // A capture of nothing else was cut so.
  for (ScreenedPhoto& photo : photos) photo.width = 900;
  EXPECT_THAT(WhyLeftOut(photos), ElementsAre("", "", ""));
}

}  // namespace
}  // namespace litags
