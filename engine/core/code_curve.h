// A curve from codes to codes, for finished pictures.
#ifndef LITAGS_ENGINE_CORE_CODE_CURVE_H_
#define LITAGS_ENGINE_CORE_CODE_CURVE_H_

#include <algorithm>
#include <array>

namespace litags {

// What becomes of the code i / 255; 1 is white.
using CodeCurve = std::array<float, 256>;

// Between the curve's codes linear; what is beyond black and white stays as far beyond, NaN NaN.
inline float ApplyCurve(const CodeCurve& curve, float code) {
  const float inside = code > 0 ? std::min(code, 1.0f) : 0.0f;
  const int i = std::min(static_cast<int>(255 * inside), 254);
  return curve[i] + (255 * inside - i) * (curve[i + 1] - curve[i]) + (code - inside);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CODE_CURVE_H_
