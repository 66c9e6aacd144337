// The sRGB transfer curve, luma, and planes of bytes.
#ifndef LITAGS_ENGINE_CORE_COLOR_H_
#define LITAGS_ENGINE_CORE_COLOR_H_

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/core/image.h"

namespace litags {

// sRGB-encoded value in [0, 1] to linear light in [0, 1] (IEC 61966-2-1).
inline double LinearFromSrgb(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

// Linear light in [0, 1] to sRGB-encoded value in [0, 1]; the inverse of the above.
inline double SrgbFromLinear(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}

// Weights of red, green and blue in luma, ITU-R BT.601, as JPEG has it.
constexpr float kLumaRed = 0.299f, kLumaGreen = 0.587f, kLumaBlue = 0.114f;

// In the unit of red, green and blue: a float, a double of doubles.
template <class T>
auto Luma(T red, T green, T blue) {
  return kLumaRed * red + kLumaGreen * green + kLumaBlue * blue;
}
template <class T>
auto Luma(const T* rgb) {
  return Luma(rgb[0], rgb[1], rgb[2]);
}

// One byte per pixel, [H, W], rows top to bottom.
struct PlaneU8 {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> data;

  PlaneU8() = default;
  PlaneU8(int w, int h) : width(w), height(h), data(size_t(w) * h) {}
  bool empty() const { return data.empty(); }
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_COLOR_H_
