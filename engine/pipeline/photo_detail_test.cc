#include "engine/pipeline/photo_detail.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>

#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/pipeline/photo_screen.h"

namespace litags {
namespace {

constexpr int kWidth = 640, kHeight = 480;

// Squares of random greys before each other, as many of a size as s^-3 says: the dead leaves model,
// whose spectrum is that of photos (Lee, Mumford and Huang 2001). Luma in [0, 1].
cv::Mat Place(uint64_t seed) {
  cv::Mat place(kHeight, kWidth, CV_32F, cv::Scalar(0.5));
  const CounterRng rng(seed, 4);
  for (uint64_t i = 0; i < 30000; ++i) {
    const int side = std::min(300, static_cast<int>(3 / std::sqrt(1 - rng.Uniform(4 * i))));
    const cv::Point at(static_cast<int>(rng.Below(4 * i + 1, kWidth + side)) - side,
                       static_cast<int>(rng.Below(4 * i + 2, kHeight + side)) - side);
    cv::rectangle(place, at, at + cv::Point(side, side), 0.1 + 0.8 * rng.Uniform(4 * i + 3),
                  cv::FILLED);
  }
  return place;
}

cv::Mat BlurredBy(const cv::Mat& image, double sigma) {
  cv::Mat out;
  cv::GaussianBlur(image, out, cv::Size(), sigma);
  return out;
}

// With noise, in codes of 255, rounded to them.
PhotoDetail Detail(const cv::Mat& luma, double noise = 0.5) {
  Planes photo(1, luma.rows, luma.cols);
  const CounterRng rng(2, 5);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    const double code = 255 * luma.at<float>(static_cast<int>(i)) + noise * rng.Normal(i);
    photo.data[i] = static_cast<float>(std::round(std::clamp(code, 0.0, 255.0)) / 255);
  }
  return DetailOf(photo);
}

TEST(PhotoDetail, OfABlurredPhotoIsAFractionInAnyLight) {
  for (const double light : {1.0, 0.1, 0.03}) {
    for (uint64_t seed = 0; seed < 4; ++seed) {
      const cv::Mat place = Place(seed);
      const double sharp = Detail(light * place).fine;
      EXPECT_GT(sharp, 0.2) << light;
      EXPECT_FALSE(IsBlurred(Detail(light * BlurredBy(place, 2)), sharp)) << light;
      EXPECT_TRUE(IsBlurred(Detail(light * BlurredBy(place, 8)), sharp)) << light;
    }
  }
}

TEST(PhotoDetail, NoiseIsNone) {
  const cv::Mat blurred = BlurredBy(Place(1), 8);
  EXPECT_NEAR(Detail(blurred, 8).fine, Detail(blurred, 0.5).fine, 0.01);
}

TEST(PhotoDetail, APlainWallIsNotBlurred) {
  cv::Mat wall(kHeight, kWidth, CV_32F);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {  // lit from one side, darker in the corners
      wall.at<float>(y, x) = static_cast<float>(
          0.2 + 0.3 * x / kWidth - 0.1 * std::pow(std::hypot(x - 320, y - 240) / 400, 2));
    }
  }
  for (const double noise : {0.3, 3.0}) EXPECT_FALSE(IsBlurred(Detail(wall, noise), 0.4));
}

// A folder of photos of places, of which `blurred` are out of focus.
absl::StatusOr<PhotoScreen> ScreenFolder(const std::set<int>& blurred,
                                         const RigViews& rig_views = {}) {
  const TempDir dir;
  for (int i = 0; i < 6; ++i) {
    cv::Mat place = 0.1 * Place(i);  // 3 stops under
    if (blurred.contains(i)) place = BlurredBy(place, 8);
    ImageU8 photo(kWidth, kHeight);
    for (size_t k = 0; k < photo.data.size(); ++k) {
      photo.data[k] =
          static_cast<uint8_t>(std::lround(255 * place.at<float>(static_cast<int>(k / 3))));
    }
    EXPECT_TRUE(WritePng(dir / ("p" + std::to_string(i) + ".png"), photo).ok());
  }
  CutInput input;
  input.images_dir = dir.path();
  input.rig_views = rig_views;
  return ScreenPhotos(input, 1, CancelToken());
}

TEST(PhotoScreen, ABlurredPhotoIsLeftOutByName) {
  const auto screen = ScreenFolder({3});
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_EQ(screen->left_out.size(), 1u);
  EXPECT_EQ(screen->left_out[0].name, "p3.png");
  EXPECT_THAT(screen->notes, testing::ElementsAre(
                                 testing::HasSubstr("p3.png is left out: it is blurred: it has ")));
}

// As the sky of a panorama, whose other views tell that it is sharp.
TEST(PhotoScreen, ViewsOfOnePhotoAreAsSharpAsItsSharpest) {
  RigViews rig_views;
  for (const char* view : {"p3.png", "p4.png"}) rig_views[view].rig = "around.jpg";
  const auto screen = ScreenFolder({3}, rig_views);
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_EQ(screen->photos.size(), 6u);
}

TEST(PhotoScreen, PhotosThatAreAllBlurredAreUsed) {
  const auto screen = ScreenFolder({0, 1, 2, 3, 4, 5});
  ASSERT_TRUE(screen.ok()) << screen.status();
  EXPECT_EQ(screen->photos.size(), 6u);
}

TEST(PhotoDetail, OfNothingIsNone) {
  EXPECT_EQ(Detail(cv::Mat(kHeight, kWidth, CV_32F, cv::Scalar(0))).fine, 0);
  EXPECT_EQ(Detail(cv::Mat(4, 300, CV_32F, cv::Scalar(0.5))).fine, 0);
}

}  // namespace
}  // namespace litags
