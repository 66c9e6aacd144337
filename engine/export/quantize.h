// Inside this module: numbers in few bits.
#ifndef LITAGS_ENGINE_EXPORT_QUANTIZE_H_
#define LITAGS_ENGINE_EXPORT_QUANTIZE_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace litags {

// [0, 1] in `bits` bits, nearest.
inline uint32_t PackUnit(double value, int bits) {
  const double top = (1u << bits) - 1;
  return static_cast<uint32_t>(std::clamp(std::floor(value * top + 0.5), 0.0, top));
}
inline double UnpackUnit(uint32_t value, int bits) {
  const uint32_t top = (1u << bits) - 1;
  return double{static_cast<float>(value & top)} / top;
}

inline uint8_t PackByte(double value) {
  return static_cast<uint8_t>(std::clamp(std::lround(value), 0l, 255l));
}

// A unit quaternion without its largest component, which is made positive: the three others are
// within +-sqrt(1/2), in their order.
struct SmallestThree {
  int largest;
  std::array<float, 3> rest;
};

inline SmallestThree DropLargest(const std::array<float, 4>& q) {
  SmallestThree out{};
  for (int k = 1; k < 4; ++k) {
    if (std::abs(q[k]) > std::abs(q[out.largest])) out.largest = k;
  }
  const float sign = q[out.largest] < 0 ? -1.0f : 1.0f;
  int to = 0;
  for (int k = 0; k < 4; ++k) {
    if (k != out.largest) out.rest[to++] = sign * q[k];
  }
  return out;
}

inline std::array<float, 4> AddLargest(const SmallestThree& packed) {
  std::array<float, 4> q{};
  double left = 1;
  int from = 0;
  for (int k = 0; k < 4; ++k) {
    if (k == packed.largest) continue;
    q[k] = packed.rest[from++];
    left -= double{q[k]} * q[k];
  }
  q[packed.largest] = static_cast<float>(std::sqrt(std::max(0.0, left)));
  return q;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_QUANTIZE_H_
