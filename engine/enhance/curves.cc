// Enhancers that are one curve for all pixels.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "absl/functional/function_ref.h"
#include "engine/core/color.h"
#include "engine/enhance/enhance.h"

namespace litags {
namespace {

using Histogram = std::array<double, 256>;  // share of all samples
using Curve = std::array<double, 256>;      // code to value, not clipped

Histogram HistogramOf(const ImageU8& photo) {
  Histogram histogram = {};
  for (const uint8_t code : photo.data) histogram[code] += 1.0 / photo.data.size();
  return histogram;
}

double MeanAfter(const Histogram& histogram, const Curve& curve) {
  double mean = 0;
  for (int code = 0; code < 256; ++code) mean += histogram[code] * std::min(curve[code], 1.0);
  return mean;
}

ImageU8 Apply(const ImageU8& photo, const Curve& curve) {
  std::array<uint8_t, 256> table;
  for (int code = 0; code < 256; ++code) {
    table[code] = static_cast<uint8_t>(std::lround(255 * std::clamp(curve[code], 0.0, 1.0)));
  }
  ImageU8 out = photo;
  for (uint8_t& code : out.data) code = table[code];
  return out;
}

Curve CurveOf(absl::FunctionRef<double(double)> value) {
  Curve curve;
  for (int code = 0; code < 256; ++code) curve[code] = value(code / 255.0);
  return curve;
}

// Applies the member of a family of curves whose mean is kEnhancedMean; means grow with the
// parameter, which is searched in [2^low, 2^high].
ImageU8 ApplyMatching(const ImageU8& photo, double low, double high,
                      absl::FunctionRef<Curve(double)> family) {
  const Histogram histogram = HistogramOf(photo);
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (MeanAfter(histogram, family(std::exp2(middle))) < kEnhancedMean ? low : high) = middle;
  }
  return Apply(photo, family(std::exp2(low)));
}

}  // namespace

ImageU8 EnhanceGain(const ImageU8& photo) {
  const Curve identity = CurveOf([](double v) { return v; });
  const double mean = MeanAfter(HistogramOf(photo), identity);
  const double gain = mean > 0 ? kEnhancedMean / mean : 1;
  return Apply(photo, CurveOf([&](double v) { return gain * v; }));
}

ImageU8 EnhanceLightGain(const ImageU8& photo) {
  // 12 stops up, as much down.
  return ApplyMatching(photo, -12, 12, [](double gain) {
    return CurveOf(
        [&](double v) { return SrgbFromLinear(std::min(1.0, gain * LinearFromSrgb(v))); });
  });
}

ImageU8 EnhanceGamma(const ImageU8& photo) {
  return ApplyMatching(photo, -6, 6, [](double inverse) {
    return CurveOf([&](double v) { return std::pow(v, 1 / inverse); });
  });
}

}  // namespace litags
