// For tests: small photos of every format that the engine reads and does not write.
#ifndef LITAGS_ENGINE_IO_TESTING_PHOTOS_H_
#define LITAGS_ENGINE_IO_TESTING_PHOTOS_H_

#include <array>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "engine/io/dng.h"
#include "engine/io/image_io.h"
#include "engine/io/testing_formats.h"

namespace litags {

// px
inline constexpr int kRampWidth = 40, kRampHeight = 24;

// Smooth, from black to bright.
DeepImage Ramp(int channels = 3, int width = kRampWidth, int height = kRampHeight);

// A frame of a sensor under flat light.
SensorFrame FlatFrame(std::array<int, 3> rgb, int width = kRampWidth, int height = kRampHeight);

struct TestFormat {
  std::string name;
  ImageFormat format;
  // TIFF is one block of EXIF itself, and takes none.
  std::function<std::string(const DeepImage&, const Extras&)> encode;
  double error;  // that a sample may have, in 8-bit codes
};
void PrintTo(const TestFormat& format, std::ostream* out);

// Those that hold RGB: all but RAW, which dng.h writes.
const std::vector<TestFormat>& TestFormats();

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TESTING_PHOTOS_H_
