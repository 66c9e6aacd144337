#include "engine/sfm/photo_set.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/sfm/fake_colmap.h"

namespace litags {
namespace {

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

}  // namespace
}  // namespace litags
