#include "engine/pipeline/panorama_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/panorama.h"
#include "engine/io/test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
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

class PanoramaViews : public ::testing::Test {
 protected:
  PanoramaViews() {
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

  absl::StatusOr<ReconstructInput> Cut() {
    return WithViewsOfPanoramas(
        input_, 2, CancelToken(), [](const std::string&) {}, &notes_);
  }

  const TempDir dir_;
  ReconstructInput input_;
  std::vector<std::string> notes_;
};

TEST_F(PanoramaViews, StandForThePanoramaBesideOtherPhotos) {
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  const auto names = ListPhotos(cut->images_dir, "images");
  ASSERT_TRUE(names.ok()) << names.status();
  EXPECT_EQ(names->size(), 3u * 6 + 2);
  EXPECT_THAT(*names, IsSupersetOf({"a_back.png", "a_down.png", "a_front.png", "a_left.png",
                                    "a_right.png", "a_up.png", "b.png", "c.png", "e_up.png"}));
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("a.png: six views")));
  EXPECT_EQ(cut->rig_views.size(), 18u);
  EXPECT_EQ(cut->rig_views.at("a_up.png").focal_length, PanoramaViewSide(256) / 2.0);
  EXPECT_EQ(cut->rig_views.at("a_up.png").rig, "a.png");
  const auto left = ReadPhoto(cut->images_dir + "/a_left.png", "photo");
  ASSERT_TRUE(left.ok()) << left.status();
  EXPECT_NEAR(left->pixel(41, 41)[1] / kPhotoCode, 60, 2);  // a quarter from the left edge
  EXPECT_NEAR(left->pixel(41, 41)[0] / kPhotoCode, 60 + 50 + 8, 2);
}

TEST_F(PanoramaViews, MasksGoWithThem) {
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
  EXPECT_EQ(masks->size(), 7u);
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

TEST_F(PanoramaViews, OfPhotosOfOneStemHaveNamesOfTheirOwn) {
  Write("photos/a.PNG", Around(256));
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->rig_views.size(), 4u * 6);
  EXPECT_TRUE(cut->rig_views.contains("a.png_up.png"));
  EXPECT_TRUE(cut->rig_views.contains("a.PNG_up.png"));
  EXPECT_TRUE(cut->rig_views.contains("d_up.png"));
}

TEST_F(PanoramaViews, AreNotMadeOfOtherPhotosOrWithGivenCameras) {
  input_.cameras_path = "transforms.json";
  EXPECT_EQ(Cut()->images_dir, input_.images_dir);
  input_.cameras_path.clear();
  // Two of which the edges meet may be chance.
  fs::remove(dir_ / "photos/a.png");
  const auto cut = Cut();
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->images_dir, input_.images_dir);
  EXPECT_TRUE(notes_.empty());
  EXPECT_FALSE(fs::exists(dir_ / "work/panorama_views"));
}

}  // namespace
}  // namespace litags
