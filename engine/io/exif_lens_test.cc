// What EXIF says of the lens and of the exposure.
#include <gtest/gtest.h>

#include <string>

#include "engine/io/exif_test_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"

namespace litags {
namespace {

TEST(ReadImageInfo, KnowsTheFocalLengthOfExif) {
  const std::string jpeg = EncodeJpeg(TestImage(16, 8)).value();
  const auto focal = [&](const std::string& tiff) {
    return ReadImageInfo(WithJpegExif(jpeg, tiff), "f").value().focal_length;
  };
  EXPECT_EQ(focal(FocalBlock(52, 425, 100)), 52);  // the lens' own length is that of both lenses
  EXPECT_EQ(focal(FocalBlock(0, 425, 100)), 4.25);
  EXPECT_EQ(focal(FocalBlock(0, 425, 0)), 0);
  EXPECT_EQ(focal(ExifBlock(6, true)), 0);
  const std::string whole = FocalBlock(0, 425, 100);
  for (size_t n = 0; n < whole.size(); ++n) EXPECT_EQ(focal(whole.substr(0, n)), 0) << n;
}

TEST(ReadImageInfo, KnowsAnIsoThatItsFirstTagCannotHold) {
  const std::string jpeg = EncodeJpeg(TestImage(16, 8)).value();
  const auto iso = [&](const std::string& tiff) {
    return ReadImageInfo(WithJpegExif(jpeg, tiff), "f").value().iso;
  };
  EXPECT_EQ(iso(IsoBlock(6400, 0x8832, 12800)), 6400);
  EXPECT_EQ(iso(IsoBlock(65535, 0x8832, 409600)), 409600);
  EXPECT_EQ(iso(IsoBlock(65535, 0x8831, 102400)), 102400);
  EXPECT_EQ(iso(IsoBlock(65535, 0x8833, 102400)), 102400);
  EXPECT_EQ(iso(IsoBlock(65535, 0x8830, 2)), 0);  // it is not said
}

TEST(ExifFocalLength, IsThatOfThePicturesSize) {
  const std::string jpeg = EncodeJpeg(TestImage(360, 240)).value();
  const auto focal = [&](const std::string& tiff) {
    return ExifFocalLength(ReadImageInfo(WithJpegExif(jpeg, tiff), "f").value());
  };
  EXPECT_NEAR(focal(FocalBlock(36, 425, 100)), 360, 0.1);  // of film of 36 mm
  EXPECT_EQ(focal(FocalBlock(0, 425, 100)), 0);            // of a sensor of any size
  // 24 mm wide with 6000 px, of which 360 are left.
  EXPECT_NEAR(focal(LensBlock(0, 24, 6350, 6000, 4000)), 360, 0.1);
  EXPECT_NEAR(focal(LensBlock(36, 50, 6350, 6000, 4000)), 360, 0.1);
  EXPECT_NEAR(focal(LensBlock(36, 50, 6350, 4000, 6000)), 360, 0.1);  // upright since
}

// The middle of what the lens gave, enlarged to the size of all.
TEST(ExifFocalLength, GrowsWithTheDigitalZoom) {
  const std::string jpeg = EncodeJpeg(TestImage(360, 240)).value();
  const auto info = [&](int in_35mm, int zoom) {
    const std::string tiff = LensBlock(in_35mm, 24, 6350, 6000, 4000, zoom);
    return ReadImageInfo(WithJpegExif(jpeg, tiff), "f").value();
  };
  EXPECT_NEAR(ExifFocalLength(info(0, 10)), 360, 0.1);
  EXPECT_NEAR(ExifFocalLength(info(0, 20)), 720, 0.2);
  EXPECT_EQ(info(0, 20).focal_length, 48);
  EXPECT_EQ(info(0, 5).focal_length, 24);  // there is no zoom below 1
  // That in 35 mm may have it, or not.
  EXPECT_EQ(ExifFocalLength(info(36, 20)), ExifFocalLength(info(36, 0)));
  EXPECT_EQ(info(36, 20).camera, "zoom 2.00\n");
  EXPECT_EQ(info(36, 10).camera, "");
}

TEST(ExifFocalLength, NonsenseIsNone) {
  const std::string jpeg = EncodeJpeg(TestImage(360, 240)).value();
  const auto focal = [&](const std::string& tiff) {
    return ExifFocalLength(ReadImageInfo(WithJpegExif(jpeg, tiff), "f").value());
  };
  EXPECT_EQ(focal(LensBlock(36, 24, 6350, 6000, 3000)), 0);  // cut since
  EXPECT_EQ(focal(LensBlock(0, 24, 6350, 360, 240)), 0);     // a sensor of 1.4 mm: shrunk since
  EXPECT_EQ(focal(LensBlock(0, 24, 0, 6000, 4000)), 0);
  EXPECT_EQ(focal(FocalBlock(8, 425, 100)), 0);     // 132 degrees
  EXPECT_EQ(focal(FocalBlock(4000, 425, 100)), 0);  // half a degree
  EXPECT_EQ(focal(ExifBlock(6, true)), 0);
}

}  // namespace
}  // namespace litags
