#include "engine/io/panorama.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "engine/core/rng.h"

namespace litags {
namespace {

// Codes of a panorama by the direction that a pixel looks along (x right, y down, z forward).
using Sky = std::function<double(double x, double y, double z)>;

Photo PanoramaOf(int width, const Sky& sky, double noise = 0) {
  Photo photo(width, width / 2);
  const CounterRng rng(1, 2);
  for (int y = 0; y < photo.height; ++y) {
    const double down = ((y + 0.5) / photo.height - 0.5) * std::numbers::pi;
    for (int x = 0; x < width; ++x) {
      const double right = ((x + 0.5) / width * 2 - 1) * std::numbers::pi;
      const double code =
          sky(std::cos(down) * std::sin(right), std::sin(down), std::cos(down) * std::cos(right)) +
          noise * rng.Normal(static_cast<uint64_t>(y) * width + x);
      std::fill_n(photo.pixel(x, y), 3, NearestSample(static_cast<float>(code * kPhotoCode)));
    }
  }
  return photo;
}

double Waves(double x, double y, double z) {
  return 20 + 8 * std::sin(3 * x) + 5 * std::cos(4 * y) + 6 * std::sin(2 * z + 1);
}

TEST(Panorama, ViewsShowWhatLiesInTheirDirection) {
  const Photo panorama = PanoramaOf(512, Waves);
  const WideLens lens = PanoramaLens(512, 256, WholePanorama(512, 256));
  const int side = lens.view_side;
  EXPECT_EQ(side, 162);  // 512 / pi
  for (const CubeView& view : kCubeViews) {
    const Photo cut = CutView(panorama, lens, view);
    ASSERT_EQ(cut.width, side);
    for (const int y : {0, 3, 81, 130, 161}) {
      for (const int x : {0, 40, 80, 161}) {
        const double u = (x + 0.5) / side * 2 - 1, v = (y + 0.5) / side * 2 - 1;
        const double length = std::hypot(u, v, 1.0);
        const auto& R = view.R;
        const double code =
            Waves((R[0] * u + R[1] * v + R[2]) / length, (R[3] * u + R[4] * v + R[5]) / length,
                  (R[6] * u + R[7] * v + R[8]) / length);
        EXPECT_NEAR(cut.pixel(x, y)[1] / kPhotoCode, code, 0.05) << view.name << x << " " << y;
      }
    }
  }
}

TEST(Panorama, NeighbouringViewsMeet) {
  const Photo panorama = PanoramaOf(512, Waves);
  const WideLens lens = PanoramaLens(512, 256, WholePanorama(512, 256));
  const Photo front = CutView(panorama, lens, kCubeViews[0]);
  const Photo right = CutView(panorama, lens, kCubeViews[1]);
  const Photo up = CutView(panorama, lens, kCubeViews[4]);
  const int last = front.width - 1;
  for (const int i : {5, 80, 150}) {
    EXPECT_NEAR(front.pixel(last, i)[0], right.pixel(0, i)[0], kPhotoCode);
    EXPECT_NEAR(front.pixel(i, 0)[0], up.pixel(i, last)[0], kPhotoCode);
  }
}

TEST(Panorama, MasksAreCutAlike) {
  PlaneU8 mask(64, 32);
  for (int y = 0; y < 32; ++y) std::fill_n(&mask.data[size_t(y) * 64], 64, y < 26 ? 255 : 0);
  const WideLens lens = PanoramaLens(64, 32, WholePanorama(64, 32));
  const PlaneU8 front = CutMask(mask, lens, kCubeViews[0]);
  const PlaneU8 down = CutMask(mask, lens, kCubeViews[5]);
  EXPECT_EQ(std::count(front.data.begin(), front.data.end(), 0), 0);
  const int middle = down.width / 2;
  EXPECT_EQ(down.data[static_cast<size_t>(middle) * down.width + middle], 0);
  EXPECT_EQ(down.data[0], 255);
}

TEST(Panorama, EdgesThatMeetTellOneFromAPhoto) {
  EXPECT_TRUE(IsClosedAround(PanoramaOf(512, Waves)));
  EXPECT_TRUE(IsClosedAround(PanoramaOf(512, Waves, /*noise=*/3)));
  const auto upright = [](double, double y, double) { return 20 + 9 * y; };
  EXPECT_FALSE(IsClosedAround(PanoramaOf(512, upright)));  // a sky and a floor
  Photo half = PanoramaOf(1024, Waves);                    // of it, a photo of the same size
  half = Cut(half, {100, 0, 512, 256});
  EXPECT_FALSE(IsClosedAround(half));
  EXPECT_FALSE(IsClosedAround(Photo(512, 256)));
  Photo thing(512, 256);  // before black
  for (int y = 60; y < 200; ++y) std::copy_n(half.pixel(150, y), 3 * 200, thing.pixel(150, y));
  EXPECT_FALSE(IsClosedAround(thing));
  EXPECT_FALSE(IsClosedAround(Cut(PanoramaOf(512, Waves), {0, 0, 512, 250})));
}

TEST(Panorama, MetadataSaysSo) {
  const std::string head = "\xFF\xD8\xFF\xE1..http://ns.adobe.com/xap/1.0/<x:xmpmeta ";
  const std::string sphere = head + "GPano:ProjectionType=\"equirectangular\" ";
  EXPECT_TRUE(StatedPanorama(sphere, 512, 256));
  EXPECT_FALSE(StatedPanorama(sphere, 512, 200));  // of what part?
  EXPECT_TRUE(StatedPanorama(head + "<GPano:ProjectionType>equirectangular</GPano:ProjectionType>",
                             512, 256));
  EXPECT_FALSE(StatedPanorama(head + "GPano:ProjectionType=\"cylindrical\"", 512, 256));
  EXPECT_FALSE(StatedPanorama(head + "equirectangular", 512, 256));
  EXPECT_FALSE(StatedPanorama("GPano:ProjectionType", 512, 256));
}

// As WebP and TIFF may have them.
TEST(Panorama, MetadataBehindThePictureCount) {
  const std::string words = "GPano:ProjectionType=\"equirectangular\"";
  EXPECT_TRUE(StatedPanorama("RIFF" + std::string(2 << 20, '.') + words, 512, 256));
}

TEST(Panorama, TheWholeMadeSmallerIsTheWhole) {
  const std::string whole =
      "GPano:ProjectionType=\"equirectangular\" GPano:FullPanoWidthPixels=\"5376\" "
      "GPano:FullPanoHeightPixels=\"2688\" GPano:CroppedAreaImageWidthPixels=\"5376\" "
      "GPano:CroppedAreaImageHeightPixels=\"2688\"";
  for (int width = 300; width < 600; ++width) {
    const auto part = StatedPanorama(whole, width, width / 2);
    ASSERT_TRUE(part) << width;
    EXPECT_EQ(part->whole_width, width);
    EXPECT_EQ(part->whole_height, width / 2);
  }
}

TEST(Panorama, MetadataTellItsPart) {
  const std::string part =
      "GPano:ProjectionType=\"equirectangular\" GPano:FullPanoWidthPixels=\"1000\" "
      "GPano:FullPanoHeightPixels=\"500\" GPano:CroppedAreaImageWidthPixels=\"600\" "
      "<GPano:CroppedAreaImageHeightPixels>200</GPano:CroppedAreaImageHeightPixels>"
      "<GPano:CroppedAreaLeftPixels>100</GPano:CroppedAreaLeftPixels>"
      "GPano:CroppedAreaTopPixels=\"150\"";
  const auto half = StatedPanorama(part, 300, 100);  // made smaller since
  ASSERT_TRUE(half);
  EXPECT_EQ(half->whole_width, 500);
  EXPECT_EQ(half->whole_height, 250);
  EXPECT_EQ(half->left, 50);
  EXPECT_EQ(half->top, 75);
  EXPECT_FALSE(StatedPanorama(part, 300, 90));  // cut since
  // The middle of the sphere is 200 px from its left and 50 from its top.
  const WideLens lens = PanoramaLens(300, 100, *half);
  const auto ahead = lens.seen({0, 0, 1});
  ASSERT_TRUE(ahead);
  EXPECT_NEAR((*ahead)[0], 200, 1e-9);
  EXPECT_NEAR((*ahead)[1], 50, 1e-9);
  EXPECT_FALSE(lens.seen({0, -1, 0.1}));
  EXPECT_FALSE(lens.seen({0, 0, -1}));
  EXPECT_EQ(PanoramaLens(300, 100, {1e30, 1e30, 0, 0}).view_side, 4096);
}

}  // namespace
}  // namespace litags
