#include "engine/core/mask.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "engine/core/error.h"
#include "engine/core/photo.h"

namespace litags {
namespace {

// 0 inside [x0, x1) x [y0, y1).
PlaneU8 MaskWithHole(int width, int height, int x0, int y0, int x1, int y1) {
  PlaneU8 mask(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool hole = x >= x0 && x < x1 && y >= y0 && y < y1;
      mask.data[size_t(y) * width + x] = hole ? 0 : kCounts;
    }
  }
  return mask;
}

// Grows to the right, by 3 codes a pixel.
ImageU8 Ramp(int width, int height) {
  ImageU8 image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) image.pixel(x, y)[c] = static_cast<uint8_t>(20 + 3 * x + 10 * c);
    }
  }
  return image;
}

std::string ReasonOf(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail.has_value() ? detail->reason + " " + detail->field : "none";
}

TEST(Mask, PixelsThatCountAreCountedAndVisitedInOrder) {
  const PlaneU8 mask = MaskWithHole(5, 3, 1, 1, 3, 2);
  EXPECT_EQ(CountedPixels(mask, 15), 13u);
  EXPECT_EQ(CountedPixels({}, 15), 15u);
  std::vector<size_t> counted, masked, all;
  ForCounted(mask, 15, [&](size_t i) { counted.push_back(i); });
  ForMasked(mask, [&](size_t i) { masked.push_back(i); });
  ForCounted({}, 3, [&](size_t i) { all.push_back(i); });
  EXPECT_EQ(masked, (std::vector<size_t>{6, 7}));
  EXPECT_EQ(counted.size(), 13u);
  EXPECT_EQ(counted[6], 8u);
  EXPECT_EQ(all, (std::vector<size_t>{0, 1, 2}));
}

TEST(Mask, FillingChangesMaskedPixelsOnlyAndForgetsWhatTheyWere) {
  const PlaneU8 mask = MaskWithHole(33, 17, 8, 3, 21, 12);
  const ImageU8 photo = Ramp(33, 17);
  ImageU8 white = photo, black = photo;
  ForMasked(mask, [&](size_t i) {
    for (int c = 0; c < 3; ++c) white.data[3 * i + c] = 255, black.data[3 * i + c] = 0;
  });
  FillMasked(mask, &white);
  FillMasked(mask, &black);
  EXPECT_EQ(white.data, black.data);
  ForCounted(mask, mask.data.size(), [&](size_t i) {
    for (int c = 0; c < 3; ++c) ASSERT_EQ(white.data[3 * i + c], photo.data[3 * i + c]);
  });
}

TEST(Mask, AHoleInARampIsFilledWithoutAnEdge) {
  const PlaneU8 mask = MaskWithHole(32, 16, 10, 4, 18, 12);
  ImageU8 filled = Ramp(32, 16);
  const ImageU8 ramp = filled;
  ForMasked(mask, [&](size_t i) { filled.data[3 * i] = 255; });
  FillMasked(mask, &filled);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 32; ++x) {
      // 8 px of ramp are 24 codes; averages of the surroundings stay within half of that.
      EXPECT_NEAR(filled.pixel(x, y)[0], ramp.pixel(x, y)[0], 12) << x << " " << y;
    }
  }
}

TEST(Mask, APhotoIsFilledAsFinelyAsItIsStored) {
  const PlaneU8 mask = MaskWithHole(32, 16, 10, 4, 18, 12);
  // A ramp of a tenth of a code a pixel, from below black to above: rounded to codes it is a step.
  Photo photo(32, 16);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = 6 * int(i / 3 % 32) - 90;
  const Photo ramp = photo;
  ForMasked(mask, [&](size_t i) { std::fill_n(&photo.data[3 * i], 3, kPhotoWhite); });
  FillMasked(mask, &photo);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    const bool counts = mask.data[i / 3] != 0;
    // 8 px of ramp are 48 samples.
    ASSERT_NEAR(photo.data[i], ramp.data[i], counts ? 0 : 24) << i;
  }
  // The mean of what surrounds a hole in noise around black is black: halves are rounded upwards on
  // either side of it.
  Photo noise(2, 2);
  for (int c = 0; c < 3; ++c) noise.pixel(0, 0)[c] = -5, noise.pixel(1, 0)[c] = 4;
  FillMasked(MaskWithHole(2, 2, 0, 1, 2, 2), &noise);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(noise.pixel(0, 1)[c], 0);
}

TEST(Mask, AnImageWithoutPixelsThatCountBecomesBlack) {
  ImageU8 image = Ramp(7, 5);
  FillMasked(PlaneU8(7, 5), &image);
  EXPECT_EQ(image.data, ImageU8(7, 5).data);
  Photo photo = PhotoFromU8(Ramp(7, 5));
  FillMasked(PlaneU8(7, 5), &photo);
  EXPECT_EQ(photo.data, Photo(7, 5).data);
}

TEST(Mask, NamesAreThePhotosNameOrItsStemWithPng) {
  const auto matched = MatchMasks({"a.jpg", "b.png", "c.d.jpeg", "e.png"},
                                  {"a.jpg.png", "b.png", "c.d.png", "e.png.PNG"});
  ASSERT_TRUE(matched.ok()) << matched.status();
  EXPECT_EQ(matched->at("a.jpg"), "a.jpg.png");
  EXPECT_EQ(matched->at("b.png"), "b.png");
  EXPECT_EQ(matched->at("c.d.jpeg"), "c.d.png");
  EXPECT_EQ(matched->at("e.png"), "e.png.PNG");
}

TEST(Mask, NamesOfOtherToolsAreKnown) {
  const auto matched = MatchMasks({"a.jpg", "b.jpg", "c.jpg", "d_mask.jpg"},
                                  {"a_mask.png", "b.jpg.mask.png", "c.mask.png", "d_mask.png"});
  ASSERT_TRUE(matched.ok()) << matched.status();
  EXPECT_EQ(matched->at("a.jpg"), "a_mask.png");
  EXPECT_EQ(matched->at("b.jpg"), "b.jpg.mask.png");
  EXPECT_EQ(matched->at("c.jpg"), "c.mask.png");
  EXPECT_EQ(matched->at("d_mask.jpg"), "d_mask.png");
}

TEST(Mask, NamesThatFitNoPhotoOrSeveralAreRefused) {
  EXPECT_EQ(ReasonOf(MatchMasks({"a.jpg"}, {"b.png"}).status()), "MASK_WITHOUT_PHOTO masks[b.png]");
  EXPECT_EQ(ReasonOf(MatchMasks({"a.jpg", "a.png"}, {"a.png"}).status()),
            "MASK_AMBIGUOUS masks[a.png]");
  EXPECT_TRUE(MatchMasks({"a.jpg", "a.png"}, {"a.jpg.png", "a.png.png"}).ok());
  EXPECT_EQ(ReasonOf(MatchMasks({"a.jpg"}, {"a.jpg.png", "a.png"}).status()),
            "MASK_TWICE masks[a.png]");
}

}  // namespace
}  // namespace litags
