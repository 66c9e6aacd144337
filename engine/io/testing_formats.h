// For tests and fuzz seeds: photos in formats that the engine reads and does not write.
#ifndef LITAGS_ENGINE_IO_TESTING_FORMATS_H_
#define LITAGS_ENGINE_IO_TESTING_FORMATS_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/image.h"

namespace litags {

// Codes of 0..65535, `channels` interleaved.
struct DeepImage {
  int width = 0, height = 0, channels = 3;
  std::vector<uint16_t> codes;

  const uint16_t* pixel(int x, int y) const {
    return codes.data() + size_t(channels) * (size_t(y) * width + x);
  }
};

DeepImage Deepen(const ImageU8& image);

// With `icc` and an EXIF block (TIFF) where they are not empty.
struct Extras {
  std::string icc = {}, exif = {};
};

std::string EncodeTestWebp(const ImageU8& image, const Extras& extras = {}, bool lossless = true);

// Codes of Y, Cb and Cr as a file holds them.
struct TestYCbCr {
  int width = 0, height = 0, bits = 8;
  int across = 2, down = 2;  // pixels to a sample of chroma: 1, 1 is 4:4:4, and 2, 2 is 4:2:0
  bool grey = false;
  int matrix = 6, transfer = 13;  // code points of ITU-T H.273
  bool full_range = true;
  std::array<std::vector<uint16_t>, 3> codes = {};

  int width_of(int c) const { return c == 0 ? width : (width + across - 1) / across; }
  int height_of(int c) const { return c == 0 ? height : (height + down - 1) / down; }
};

// Lossy. 4:2:0 of 8 bits, limited range.
std::string EncodeTestWebp(const TestYCbCr& picture, int quality);

struct TiffLayout {
  int bits = 8;         // 8, 16; 32: floating point
  float white = 1;      // code 65535 in floating point
  int compression = 1;  // TIFF's number
  bool tiled = false;
  bool planar = false;
  int orientation = 1;
  int extra = 0;                           // samples behind the colours
  bool big = false;                        // BigTIFF
  int pages = 1;                           // those after the first are black
  double exposure_time = 0, f_number = 0;  // EXIF, with the next; 0: none
  int iso = 0;
  std::string icc = {};
};
std::string EncodeTestTiff(const DeepImage& image, const TiffLayout& layout = {});

// Nearly lossless, chroma halved. bits: 8, 10 or 12; AVIF: not 10, which Debian's libheif 1.15
// fails at.
std::string EncodeTestHeif(const DeepImage& image, bool av1, int bits, const Extras& extras = {});

struct HeifLayout {
  bool av1 = false;
  int quality = 100;    // 100: lossless
  int orientation = 1;  // EXIF's, as properties of the file
  bool alpha = false;   // half transparent
};
std::string EncodeTestHeif(const TestYCbCr& picture, const HeifLayout& layout,
                           const Extras& extras = {});

// Lossless; bits: 8 or 16. `depths`: channels of depth beside the colours, which are black.
// `transfer`: a code point of ITU-T H.273, sRGB's, where there is no profile.
std::string EncodeTestJxl(const DeepImage& image, int bits, const Extras& extras = {},
                          int depths = 0, int transfer = 13);

// An ICC profile made by lcms2. kLinear, kDisplayP3, kAdobeRgb: RGB; kGreyLinear; kCmyk: paper is
// white, each ink takes away its colour.
enum class TestProfile { kSrgb, kLinear, kDisplayP3, kAdobeRgb, kGreyLinear, kCmyk };
std::string MakeTestProfile(TestProfile kind);

// JPEG segments that hold a profile, put behind the start of the image.
std::string WithJpegProfile(const std::string& jpeg, const std::string& icc);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TESTING_FORMATS_H_
