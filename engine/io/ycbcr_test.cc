// HEIC, AVIF and lossy WebP: YCbCr to RGB, in floating point.
#include "engine/io/ycbcr.h"

#include <webp/decode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/image_io.h"
#include "engine/io/testing_formats.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using Rgb = std::array<double, 3>;

// Smooth luma and chroma of all hues.
TestYCbCr Waves(int width, int height, TestYCbCr picture) {
  picture.width = width;
  picture.height = height;
  const int unit = 1 << (picture.bits - 8);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < picture.height_of(c); ++y) {
      for (int x = 0; x < picture.width_of(c); ++x) {
        const double wave = c == 0 ? std::sin(0.2 * x) : std::cos(0.3 * x + c * y);
        picture.codes[c].push_back(static_cast<uint16_t>((128 + 90 * wave) * unit));
      }
    }
  }
  return picture;
}

// Component `c` at a pixel: chroma lies amid the pixels that share it, or on the first.
double At(const TestYCbCr& picture, int c, int x, int y) {
  const int width = picture.width_of(c), height = picture.height_of(c);
  const double across = c == 0 ? 1 : picture.across, down = c == 0 ? 1 : picture.down;
  const double u = std::clamp((x + 0.5) / across - 0.5, 0.0, width - 1.0);
  const double v = std::clamp((y + 0.5) / down - 0.5, 0.0, height - 1.0);
  double sum = 0;
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      const double weight = std::max(0.0, 1 - std::abs(u - i)) * std::max(0.0, 1 - std::abs(v - j));
      if (weight > 0) sum += weight * picture.codes[c][size_t(j) * width + i];
    }
  }
  return sum;
}

// ITU-T H.273, 8.3, solved for R, G and B.
Rgb RgbAt(const TestYCbCr& picture, int x, int y) {
  const double unit = std::exp2(picture.bits - 8), white = std::exp2(picture.bits) - 1;
  const double black = picture.full_range ? 0 : 16 * unit;
  const double luma_range = picture.full_range ? white : 219 * unit;
  const double chroma_range = picture.full_range ? white : 224 * unit;
  const double luma = (At(picture, 0, x, y) - black) / luma_range;
  if (picture.grey) return {luma, luma, luma};
  const double cb = At(picture, 1, x, y), cr = At(picture, 2, x, y);
  if (picture.matrix == 0) return {(cr - black) / luma_range, luma, (cb - black) / luma_range};
  const double kr = picture.matrix == 1 ? 0.2126 : picture.matrix == 9 ? 0.2627 : 0.299;
  const double kb = picture.matrix == 1 ? 0.0722 : picture.matrix == 9 ? 0.0593 : 0.114;
  const double blue = luma + 2 * (1 - kb) * (cb - 128 * unit) / chroma_range;
  const double red = luma + 2 * (1 - kr) * (cr - 128 * unit) / chroma_range;
  return {red, (luma - kr * red - kb * blue) / (1 - kr - kb), blue};
}

void ExpectFormula(const std::string& bytes, const TestYCbCr& picture) {
  const auto photo = DecodePhoto(bytes, "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  ASSERT_EQ(photo->width, picture.width);
  ASSERT_EQ(photo->height, picture.height);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const Rgb want = RgbAt(picture, x, y);
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(photo->pixel(x, y)[c], want[c] * kPhotoWhite, 0.6)
            << "channel " << c << " of " << x << ", " << y;
      }
    }
  }
}

TEST(HeifYCbCr, IsTheStandardsForEveryLayoutRangeAndMatrix) {
  const TestYCbCr layouts[] = {{},
                               {.down = 1},
                               {.across = 1, .down = 1},
                               {.grey = true},
                               {.across = 1, .down = 1, .matrix = 0}};
  for (const bool av1 : {false, true}) {
    for (const int bits : {8, av1 ? 12 : 10}) {
      for (TestYCbCr layout : layouts) {
        for (const bool full_range : {false, true}) {
          layout.bits = bits;
          layout.full_range = full_range;
          for (const int matrix : {1, 6, 9}) {
            if (layout.matrix == 0 && matrix > 1) continue;
            if (layout.matrix != 0) layout.matrix = matrix;
            SCOPED_TRACE(testing::Message()
                         << (av1 ? "AV1 " : "HEVC ") << bits << " bits, " << layout.across
                         << layout.down << layout.grey << " " << layout.matrix << full_range);
            const TestYCbCr picture = Waves(34, 22, layout);
            ExpectFormula(EncodeTestHeif(picture, {.av1 = av1}), picture);
          }
        }
      }
    }
  }
}

TEST(HeifYCbCr, OfOddSizeKeepsItsLastRowAndColumn) {
  const TestYCbCr picture = Waves(33, 21, {});
  ExpectFormula(EncodeTestHeif(picture, {.av1 = true}), picture);
}

// Without a property of colours, the stream tells that it is none of standard range.
TEST(HeifYCbCr, ForHdrScreensIsRefusedByWhatItsStreamSays) {
  constexpr int kPq = 16;
  for (const bool av1 : {false, true}) {
    TestYCbCr picture = Waves(34, 22, {});
    for (const int transfer : {picture.transfer, kPq}) {
      picture.transfer = transfer;
      std::string bytes = EncodeTestHeif(picture, {.av1 = av1});
      for (size_t at = 0; (at = bytes.find("colr", at)) != std::string::npos;) {
        bytes.replace(at, 4, "free");
      }
      EXPECT_EQ(Reason(DecodePhoto(bytes, "f").status()),
                transfer == kPq ? "IMAGE_UNSUPPORTED" : "")
          << av1;
    }
  }
}

// Of AV1: libde265 does not tell a stream's HLG. Limited range goes on above white.
TEST(HeifYCbCr, OfHlgIsTheLightOfTheScene) {
  constexpr int kHlg = 18;
  for (const int code : {600, 2008, 2800, 3760, 4000}) {
    TestYCbCr picture{.width = 34, .height = 22, .bits = 12, .transfer = kHlg, .full_range = false};
    for (int c = 0; c < 3; ++c) {
      picture.codes[c].assign(size_t(picture.width_of(c)) * picture.height_of(c),
                              static_cast<uint16_t>(c == 0 ? code : 2048));
    }
    const auto photo = DecodePhoto(EncodeTestHeif(picture, {.av1 = true}), "f");
    ASSERT_TRUE(photo.ok()) << photo.status();
    // ITU-R BT.2100.
    const double signal = (code - 256) / 3504.0;
    const double light = signal <= 0.5
                             ? signal * signal / 3
                             : (std::exp((signal - 0.55991073) / 0.17883277) + 0.28466892) / 12;
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(photo->pixel(17, 11)[c], kPhotoWhite * SrgbFromLinear(light), 3) << code;
    }
  }
}

TEST(HeifYCbCr, IsTurnedAsItsPropertiesSay) {
  const TestYCbCr picture = Waves(34, 22, {});
  const Photo upright = DecodePhoto(EncodeTestHeif(picture, {}), "f").value();
  for (int orientation = 2; orientation <= 8; ++orientation) {
    const auto photo = DecodePhoto(EncodeTestHeif(picture, {.orientation = orientation}), "f");
    ASSERT_TRUE(photo.ok()) << photo.status();
    EXPECT_EQ(photo->data, TurnUpright(upright, orientation).data) << orientation;
  }
}

TEST(HeifYCbCr, TransparencyIsDropped) {
  for (const bool av1 : {false, true}) {
    const TestYCbCr picture = Waves(34, 22, {});
    const std::string bytes = EncodeTestHeif(picture, {.av1 = av1, .alpha = true});
    EXPECT_NE(bytes.find("auxC"), std::string::npos);
    ExpectFormula(bytes, picture);
  }
}

// Makes a box larger, or smaller, and what it is in.
void Grow(std::initializer_list<const char*> boxes, int by, std::string* file) {
  for (const char* box : boxes) {
    char& size = (*file)[file->find(box) - 1];  // the last of four bytes
    const int sum = static_cast<uint8_t>(size) + by;
    ASSERT_TRUE(sum >= 0 && sum < 256);
    size = static_cast<char>(sum);
  }
}

// iPhones since iOS 18: alpha or a gain map, and EXIF, are also of an item that is no picture.
TEST(HeifYCbCr, IsReadWithAlphaAndExifOfOtherItemsToo) {
  for (const bool av1 : {false, true}) {
    const TestYCbCr picture = Waves(34, 22, {});
    std::string bytes =
        EncodeTestHeif(picture, {.av1 = av1, .alpha = true}, {.exif = FocalBlock(26, 425, 100)});
    for (const char* reference : {"auxl", "cdsc"}) {
      const size_t at = bytes.find(reference) + 4;  // the item, how many it is of, and those
      ASSERT_EQ(bytes[at + 3], 1);
      bytes[at + 3] = 2;
      bytes.insert(at + 6, std::string("\0\x63", 2));
      Grow({reference, "iref", "meta"}, 2, &bytes);
    }
    // Instead of a brand, so that the pictures lie where they lay.
    Grow({"ftyp"}, -4, &bytes);
    bytes.erase(16, 4);
    const auto info = ReadImageInfo(bytes, "f");
    ASSERT_TRUE(info.ok()) << info.status();
    EXPECT_EQ(info->focal_length, 26);
    ExpectFormula(bytes, picture);
  }
}

TEST(ChromaTaps, LieAmidTheirPixelsOrOnTheFirst) {
  const std::vector<Tap> centre = TapsOf(4, 2, 0.5), first = TapsOf(4, 2, 0.5, ChromaSite::kFirst);
  const auto at = [](const Tap& tap) { return tap.low + tap.weight * (tap.high - tap.low); };
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(at(centre[i]), std::clamp(i / 2.0 - 0.25, 0.0, 1.0)) << i;
    EXPECT_EQ(at(first[i]), std::min(i / 2.0, 1.0)) << i;
  }
}

// What a dark photo is: a few codes of light, and noise that reaches below black.
constexpr Rgb kDark = {1.0, 3.0, 1.5};  // codes

TestYCbCr DarkNoise(int bits, bool full_range) {
  TestYCbCr picture{.width = 128, .height = 96, .bits = bits, .full_range = full_range};
  const double luma = 0.299 * kDark[0] + 0.587 * kDark[1] + 0.114 * kDark[2];
  const double means[] = {luma, (kDark[2] - luma) / 1.772, (kDark[0] - luma) / 1.402};
  const double unit = std::exp2(bits - 8);
  for (int c = 0; c < 3; ++c) {
    const double zero = c > 0 ? 128 : full_range ? 0 : 16;
    const double range = full_range ? 1 : c == 0 ? 219.0 / 255 : 224.0 / 255;
    const double most = c == 0 ? luma : 4;  // of the noise, codes
    const CounterRng rng(3, c);
    const int samples = picture.width_of(c) * picture.height_of(c);
    for (int i = 0; i < samples; ++i) {
      const double noise = most * (2 * rng.Uniform(2 * i) - 1);
      const double code = unit * (zero + range * (means[c] + noise)) + rng.Uniform(2 * i + 1);
      picture.codes[c].push_back(static_cast<uint16_t>(code));
    }
  }
  return picture;
}

void ExpectDarkMean(const std::string& bytes) {
  const auto photo = DecodePhoto(bytes, "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  Rgb sum = {}, clipped = {};
  for (size_t i = 0; i < photo->data.size(); ++i) {
    const double code = photo->data[i] / kPhotoCode;
    sum[i % 3] += code / static_cast<double>(photo->pixels());
    clipped[i % 3] += std::max(0.0, code) / static_cast<double>(photo->pixels());
  }
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], kDark[c], 0.2) << c;
  // What the noise is for: cut off at black, red and blue are too bright.
  EXPECT_GT(clipped[0], kDark[0] + 0.3);
  EXPECT_GT(clipped[2], kDark[2] + 0.3);
}

TEST(HeifYCbCr, NoiseAroundBlackKeepsItsMean) {
  for (const bool av1 : {false, true}) {
    for (const int bits : {8, av1 ? 12 : 10}) {
      for (const bool full_range : {false, true}) {
        SCOPED_TRACE(testing::Message() << av1 << " " << bits << " " << full_range);
        ExpectDarkMean(EncodeTestHeif(DarkNoise(bits, full_range), {.av1 = av1, .quality = 95}));
      }
    }
  }
}

TEST(WebpYCbCr, NoiseAroundBlackKeepsItsMean) {
  ExpectDarkMean(EncodeTestWebp(DarkNoise(8, false), 98));
}

TEST(WebpYCbCr, IsTheStandardsOfWhatLibwebpDecodes) {
  for (const auto& [width, height] : {std::pair{33, 17}, {34, 22}, {1, 1}}) {
    TestYCbCr picture = Waves(width, height, {.full_range = false});
    const std::string bytes = EncodeTestWebp(picture, 90);
    int w = 0, h = 0, strides[2] = {};
    uint8_t *cb = nullptr, *cr = nullptr;
    uint8_t* luma = WebPDecodeYUV(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(), &w,
                                  &h, &cb, &cr, &strides[0], &strides[1]);
    ASSERT_NE(luma, nullptr);
    const uint8_t* const planes[] = {luma, cb, cr};
    for (int c = 0; c < 3; ++c) {
      for (size_t i = 0; i < picture.codes[c].size(); ++i) {
        const size_t x = i % picture.width_of(c), y = i / picture.width_of(c);
        picture.codes[c][i] = planes[c][y * strides[c > 0] + x];
      }
    }
    WebPFree(luma);
    ExpectFormula(bytes, picture);
  }
}

}  // namespace
}  // namespace litags
