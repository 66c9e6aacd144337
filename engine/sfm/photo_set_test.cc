#include "engine/sfm/photo_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/sfm/fake_colmap.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

TEST(PhotoSet, FocalLengthsThatDifferByLessThanAPercentAreOneLens) {
  FakeColmap colmap;
  const std::string images = colmap.MakePhotos(6, 128, 96, /*level=*/12);
  const auto names = ListPhotos(images, "images");
  ASSERT_TRUE(names.ok()) << names.status();
  const int hundredths[] = {421, 420, 423,
                            422, 424, 430};  // mm; the last is a percent and more off
  for (size_t i = 0; i < 6; ++i) {
    const std::string path = images + "/" + (*names)[i];
    const std::string jpeg = EncodeJpeg(*ReadImage(path, "photo")).value();
    std::filesystem::remove(path);
    ASSERT_TRUE(WriteFileAtomically(images + "/" + Stem((*names)[i]) + ".jpg",
                                    WithJpegExif(jpeg, FocalBlock(0, hundredths[i], 100)))
                    .ok());
  }
  const auto photos = ListPhotoSet(images, 0);
  ASSERT_TRUE(photos.ok()) << photos.status();
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_EQ((*photos)[i].camera, i < 5 ? "128x96_4.2mm" : "128x96_4.3mm") << i;
  }
}

// Names of the cameras of photos that EXIF says are of these models, "" without EXIF.
std::vector<std::string> CamerasOfModels(const std::vector<std::string>& models) {
  const TempDir dir;
  const std::string jpeg = EncodeJpeg(ImageU8(128, 96)).value();
  for (size_t i = 0; i < models.size(); ++i) {
    const std::string block = CameraBlock("Maker", models[i], 26);
    const std::string photo = models[i].empty() ? jpeg : WithJpegExif(jpeg, block);
    EXPECT_TRUE(WriteFileAtomically(dir / absl::StrCat(i, ".jpg"), photo).ok());
  }
  const auto photos = ListPhotoSet(dir.path(), 0);
  std::vector<std::string> cameras;
  for (const PhotoFile& photo : *photos) cameras.push_back(photo.camera);
  return cameras;
}

TEST(PhotoSet, CamerasThatExifNamesShareNoLens) {
  EXPECT_THAT(CamerasOfModels({"Phone 2", "Phone 1", "Phone 2"}),
              ElementsAre("128x96_26mm_camera2", "128x96_26mm_camera1", "128x96_26mm_camera2"));
  EXPECT_THAT(CamerasOfModels({"Phone 1", "Phone 1", ""}),
              ElementsAre("128x96_26mm", "128x96_26mm", "128x96"));
}

TEST(PhotoSet, StepsOfADigitalZoomShareNoLens) {
  const auto cameras = [](int in_35mm) {
    const TempDir dir;
    const std::string jpeg = EncodeJpeg(ImageU8(128, 96)).value();
    for (const int zoom : {10, 14, 20}) {
      const std::string block = LensBlock(in_35mm, 4, 0, 0, 0, zoom);
      EXPECT_TRUE(
          WriteFileAtomically(dir / absl::StrCat(zoom, ".jpg"), WithJpegExif(jpeg, block)).ok());
    }
    const auto photos = ListPhotoSet(dir.path(), 0);
    std::vector<std::string> names;
    for (const PhotoFile& photo : *photos) names.push_back(photo.camera);
    return names;
  };
  EXPECT_THAT(cameras(0), ElementsAre("128x96_4mm", "128x96_5.6mm", "128x96_8mm"));
  EXPECT_THAT(cameras(26),
              ElementsAre("128x96_26mm", "128x96_26mm_camera1", "128x96_26mm_camera2"));
}

TEST(PhotoSet, SizesThatDifferByAFewPixelsAreOneLens) {
  FakeColmap colmap;
  const std::string images = colmap.MakePhotos(1, 128, 96, /*level=*/12);
  ASSERT_TRUE(WritePng(images + "/p1.png", ImageU8(131, 93)).ok());
  ASSERT_TRUE(WritePng(images + "/p2.png", ImageU8(136, 100)).ok());
  ASSERT_TRUE(WritePng(images + "/p3.png", ImageU8(137, 96)).ok());  // 9 px off
  ASSERT_TRUE(WritePng(images + "/p4.png", ImageU8(96, 128)).ok());
  const auto photos = ListPhotoSet(images, 64);
  ASSERT_TRUE(photos.ok()) << photos.status();
  const char* cameras[] = {"128x93", "128x93", "128x93", "137x96", "96x128"};
  for (size_t i = 0; i < 5; ++i) EXPECT_EQ((*photos)[i].camera, cameras[i]) << i;
  const PhotoFile& middle = (*photos)[2];
  EXPECT_EQ(std::pair(middle.copy_width, middle.copy_height), std::pair(64, 47));
  EXPECT_EQ(std::pair(middle.shown.x, middle.shown.y), std::pair(4, 3));

  // The middle of what is shown is the middle of the copy, there and back.
  const Camera copy = {.width = 64, .height = 47, .fx = 50, .fy = 50, .cx = 32, .cy = 23.5};
  const Camera camera = CameraOfPhoto(copy, middle);
  EXPECT_EQ(std::pair(camera.width, camera.height), std::pair(136, 100));
  EXPECT_EQ(camera.fx, 100);
  EXPECT_EQ(std::pair(camera.cx, camera.cy), std::pair(68.0, 49.5));
  const Camera back = CameraOfCopy(camera, middle);
  EXPECT_NEAR(back.cx, copy.cx, 1e-12);
  EXPECT_NEAR(back.cy, copy.cy, 1e-12);
  EXPECT_NEAR(back.fx, copy.fx, 1e-12);
}

}  // namespace
}  // namespace litags
