// The cubes that surfaces are cut into: how large they are, and numbers for them.
#ifndef LITAGS_ENGINE_SURFACE_GRID_H_
#define LITAGS_ENGINE_SURFACE_GRID_H_

#include <algorithm>
#include <array>
#include <cstdint>

namespace litags {

// Side of a cube in widths of a pixel, their median. Choice: a finer one is seen by less than a
// pixel of each picture, a coarser one rounds off corners.
inline constexpr double kCubePixels = 1.5;

inline constexpr int32_t kCubesAside = 1 << 20;  // of the centre: a number has 21 bits an axis

// Unique; what lies further off counts as the last.
inline uint64_t CubeNumber(const std::array<int32_t, 3>& cube) {
  uint64_t number = 0;
  for (const int32_t k : cube) {
    number = number << 21 |
             static_cast<uint64_t>(std::clamp(k, -kCubesAside, kCubesAside - 1) + kCubesAside);
  }
  return number;
}

inline std::array<int32_t, 3> CubeOfNumber(uint64_t number) {
  std::array<int32_t, 3> cube;
  for (int k = 0; k < 3; ++k) {
    cube[k] = static_cast<int32_t>(number >> (42 - 21 * k) & ((1 << 21) - 1)) - kCubesAside;
  }
  return cube;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_SURFACE_GRID_H_
