#include "engine/io/alpha_mask.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "engine/io/image_io.h"

namespace litags {
namespace {

// Opaque but for one corner.
std::string CutOut(int width, int height) {
  cv::Mat bgra(height, width, CV_8UC4, cv::Scalar(9, 9, 9, 255));
  bgra(cv::Rect(0, 0, width / 2, 1)).setTo(cv::Scalar(0, 0, 0, 0));
  std::vector<uint8_t> png;
  cv::imencode(".png", bgra, png);
  return {png.begin(), png.end()};
}

TEST(AlphaMask, IsTurnedUprightWithItsPhoto) {
  const std::string png = CutOut(6, 4);
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const PlaneU8 mask = AlphaMask(png, orientation);
    const Photo photo = TurnUpright(DecodePhoto(png, "f").value(), orientation);
    ASSERT_EQ(mask.width, photo.width) << orientation;
    ASSERT_EQ(mask.height, photo.height);
    for (size_t i = 0; i < mask.data.size(); ++i) {
      EXPECT_EQ(mask.data[i] == 0, photo.data[3 * i] == 0) << orientation << " " << i;
    }
  }
}

TEST(AlphaMask, IsEmptyWhereNothingOrAllIsHidden) {
  EXPECT_TRUE(AlphaMask(EncodePng(ImageU8(4, 4)).value(), 1).empty());  // no alpha
  EXPECT_TRUE(AlphaMask(EncodeJpeg(ImageU8(4, 4)).value(), 1).empty());
  EXPECT_TRUE(AlphaMask(CutOut(1, 4), 1).empty());
}

}  // namespace
}  // namespace litags
