#ifndef LITAGS_ENGINE_TARGET_JPEG_TEST_UTIL_H_
#define LITAGS_ENGINE_TARGET_JPEG_TEST_UTIL_H_

#include <algorithm>
#include <array>
#include <cmath>

namespace litags {

using TestColor = std::array<double, 3>;

// Y, Cb, Cr of R, G, B.
inline TestColor TestYcc(const TestColor& rgb) {
  const double y = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
  return {y, (rgb[2] - y) / 1.772, (rgb[0] - y) / 1.402};
}

// R, G and B in codes, rounded, and what libjpeg makes of them: Y, Cb and Cr rounded, halves of Cb
// and Cr down.
inline TestColor TestJpeg(const TestColor& rgb) {
  TestColor codes;
  for (int c = 0; c < 3; ++c) codes[c] = std::floor(std::clamp(rgb[c], 0.0, 255.0) + 0.5);
  const TestColor ycc = TestYcc(codes);
  constexpr double kHalf = 0.5 - 1e-4;  // in 16 bits, almost halves are halves
  return {std::floor(ycc[0] + 0.5), std::floor(ycc[1] + kHalf), std::floor(ycc[2] + kHalf)};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_JPEG_TEST_UTIL_H_
