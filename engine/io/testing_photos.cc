#include "engine/io/testing_photos.h"

namespace litags {
namespace {

ImageU8 To8Bits(const DeepImage& image) {
  ImageU8 out(image.width, image.height);
  for (size_t i = 0; i < image.codes.size(); ++i) {
    out.data[i] = static_cast<uint8_t>(image.codes[i] / 257);
  }
  return out;
}

TestFormat Tiff(const char* name, int bits, double error) {
  return {name, ImageFormat::kTiff,
          [bits](const DeepImage& image, const Extras& extras) {
            return EncodeTestTiff(image, {.bits = bits, .icc = extras.icc});
          },
          error};
}

TestFormat Heif(const char* name, bool av1, int bits, double error) {
  return {name, ImageFormat::kHeif,
          [av1, bits](const DeepImage& image, const Extras& extras) {
            return EncodeTestHeif(image, av1, bits, extras);
          },
          error};
}

TestFormat Jxl(const char* name, int bits, double error) {
  return {name, ImageFormat::kJxl,
          [bits](const DeepImage& image, const Extras& extras) {
            return EncodeTestJxl(image, bits, extras);
          },
          error};
}

}  // namespace

DeepImage Ramp(int channels, int width, int height) {
  DeepImage image{width, height, channels, {}};
  const int step = 60000 / width;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        const int code = (x * step + y * 720 / height) >> (c == 3 ? 3 : c);
        image.codes.push_back(static_cast<uint16_t>(code));
      }
    }
  }
  return image;
}

SensorFrame FlatFrame(std::array<int, 3> rgb, int width, int height) {
  SensorFrame frame;
  frame.width = width;
  frame.height = height;
  frame.black = 512;
  frame.white = 512 + 10000;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int channel = (y & 1) + (x & 1);
      frame.numbers.push_back(static_cast<uint16_t>(frame.black + rgb[channel]));
    }
  }
  return frame;
}

void PrintTo(const TestFormat& format, std::ostream* out) { *out << format.name; }

const std::vector<TestFormat>& TestFormats() {
  static const auto* const formats =
      new std::vector<TestFormat>{{"webp", ImageFormat::kWebp,
                                   [](const DeepImage& image, const Extras& extras) {
                                     return EncodeTestWebp(To8Bits(image), extras);
                                   },
                                   1.01},
                                  Tiff("tiff8", 8, 1.01),
                                  Tiff("tiff16", 16, 0.01),
                                  Heif("heic8", false, 8, 5),
                                  Heif("heic10", false, 10, 4),
                                  Heif("avif8", true, 8, 5),
                                  Heif("avif12", true, 12, 4),
                                  Jxl("jxl8", 8, 1.01),
                                  Jxl("jxl16", 16, 0.01)};
  return *formats;
}

}  // namespace litags
