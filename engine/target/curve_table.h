// A tone curve as a table, for the sources of this folder only.
#ifndef LITAGS_ENGINE_TARGET_CURVE_TABLE_H_
#define LITAGS_ENGINE_TARGET_CURVE_TABLE_H_

#include <algorithm>
#include <functional>
#include <vector>

#include "engine/core/photo.h"
#include "engine/target/float_image.h"

namespace litags {

// A growing curve from linear light to codes in [0, 1], with curve(0) = 0: it is asked for several
// times a pixel, and its power functions are slow.
class CurveTable {
 public:
  // Over [0, top]; what is brighter maps to the code of `top`. Below black the curve goes on as the
  // line that it begins with, so that noise around black stays symmetric.
  CurveTable(const std::function<double(double)>& curve, double top)
      : scale_(kSteps / top), codes_(kSteps + 2) {
    for (int i = 0; i <= kSteps; ++i) {
      codes_[i] = static_cast<float>(std::clamp(curve(i * top / kSteps), 0.0, 1.0));
    }
    codes_[kSteps + 1] = codes_[kSteps];
  }
  float operator()(float linear) const {
    const float at = std::min(linear * scale_, float(kSteps));
    if (!(at > 0)) return at * codes_[1];
    const int i = static_cast<int>(at);
    return codes_[i] + (at - i) * (codes_[i + 1] - codes_[i]);
  }
  FloatImage operator()(const FloatImage& linear) const {
    FloatImage codes(linear.size());
    for (int i = 0; i < linear.rows * linear.cols; ++i) {
      for (int c = 0; c < 3; ++c) codes(i)[c] = (*this)(linear(i)[c]);
    }
    return codes;
  }
  float SlopeAtBlack() const { return codes_[1] * scale_; }

 private:
  static constexpr int kSteps = 1 << 14;
  float scale_;
  std::vector<float> codes_;
};

inline Photo PhotoFromCodes(const FloatImage& codes) {
  Photo photo(codes.cols, codes.rows);
  for (size_t i = 0; i < photo.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) photo.data[3 * i + c] = PhotoSample(codes(int(i))[c]);
  }
  return photo;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_CURVE_TABLE_H_
