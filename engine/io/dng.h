// Sensor data out, as DNG: what the sample's camera writes, and tests of RAW read.
#ifndef LITAGS_ENGINE_IO_DNG_H_
#define LITAGS_ENGINE_IO_DNG_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace litags {

// The numbers of a sensor under a mosaic of red, green, green and blue, whose primaries are sRGB's.
struct SensorFrame {
  int width = 0, height = 0;  // px, even
  std::vector<uint16_t> numbers;
  int black = 0, white = 65535;
  std::array<double, 3> neutral = {1, 1, 1};  // what white looks like to the sensor, (0, 1]
  int orientation = 1;                        // EXIF
  double exposure_time = 0;                   // s; 0: not said, as below
  double f_number = 0;
  int iso = 0;
  int focal_length_35mm = 0;
  bool has_gain_map = false;  // says that the lens shades nothing
};

std::string EncodeDng(const SensorFrame& frame);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_DNG_H_
