#include "engine/target/chroma.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/mask.h"
#include "engine/noise/noise_estimate.h"
#include "engine/target/curve_table.h"
#include "engine/target/float_image.h"

namespace litags {
namespace {

constexpr double kBlur = 1.4;    // px; of the photo that the taps look at
constexpr int kTaps = 2;         // to either side
constexpr int kTapSpacing = 4;   // px
constexpr double kTapSigma = 4;  // px

float Luma(const cv::Vec3f& rgb) {
  return kLumaRed * rgb[0] + kLumaGreen * rgb[1] + kLumaBlue * rgb[2];
}
cv::Vec3f LumaChroma(const cv::Vec3f& rgb) {
  const float y = Luma(rgb);
  return {y, (rgb[2] - y) / 1.772f, (rgb[0] - y) / 1.402f};
}

// Deviation of the noise in the codes' luma.
double LumaNoise(const FloatImage& codes, const PlaneU8& mask) {
  FloatPlane luma(codes.size());
  for (int i = 0; i < codes.rows * codes.cols; ++i) luma(i) = Luma(codes(i));
  return NoiseOfChannel(luma[0], luma.cols, luma.rows, mask).Deviation() / 255;
}

// The mean of `linear` over the taps around (x, y) whose guides are like the one there.
cv::Vec3f BilateralMean(const FloatImage& linear, const FloatImage& guide, const PlaneU8& mask,
                        int x, int y, float per_range) {
  static const auto weights = [] {
    std::array<float, 2 * kTaps + 1> w;
    for (int i = -kTaps; i <= kTaps; ++i) {
      w[i + kTaps] = std::exp(-0.5 * std::pow(i * kTapSpacing / kTapSigma, 2));
    }
    return w;
  }();
  cv::Vec3f sum(0, 0, 0);
  float total = 0;
  for (int j = -kTaps; j <= kTaps; ++j) {
    const int v = std::clamp(y + j * kTapSpacing, 0, linear.rows - 1);
    for (int i = -kTaps; i <= kTaps; ++i) {
      const int u = std::clamp(x + i * kTapSpacing, 0, linear.cols - 1);
      if (!Counts(mask, u, v) && (i != 0 || j != 0)) continue;
      const cv::Vec3f difference = guide(v, u) - guide(y, x);
      // (1 - d^2 / 6)^3 for exp(-d^2 / 2): alike where it matters, and exactly 0 far away.
      const float near = std::max(0.0f, 1 - difference.dot(difference) * per_range);
      const float w = near * near * near * weights[j + kTaps] * weights[i + kTaps];
      sum += w * linear(v, u);
      total += w;
    }
  }
  return sum * (1 / total);  // the middle tap has a weight of 1
}

}  // namespace

Photo SmoothChroma(const Photo& photo, double gain, double strength,
                   const std::function<double(double linear)>& curve, const PlaneU8& mask) {
  const FloatImage linear = LinearImage(photo);
  const CurveTable table(curve, std::min(1.0, 1 / gain));
  FloatImage codes = table(linear);
  const double noise = LumaNoise(codes, mask);
  if (strength > 0 && noise > kVisibleChromaNoise) {
    const FloatImage blurred = Blur(linear, kBlur);
    FloatImage guide = table(blurred);
    for (cv::Vec3f& pixel : guide) pixel = LumaChroma(pixel);
    const auto hidden = static_cast<float>(noise / table.SlopeAtBlack());  // light
    const auto per_range = static_cast<float>(1 / (6 * std::pow(strength * noise, 2)));
    for (int y = 0; y < linear.rows; ++y) {
      for (int x = 0; x < linear.cols; ++x) {
        const cv::Vec3f color = BilateralMean(blurred, guide, mask, x, y, per_range);
        // Brighter or darker than the mean: by its colour where that is known, by grey where noise
        // hides it.
        const float luma = Luma(color), known = std::max(luma, 0.0f) + hidden;
        const float difference = Luma(linear(y, x)) - luma;
        for (int c = 0; c < 3; ++c) {
          const float share = (std::max(color[c], 0.0f) + hidden) / known;
          codes(y, x)[c] = table(color[c] + difference * share);
        }
      }
    }
  }
  return PhotoFromCodes(codes);
}

}  // namespace litags
