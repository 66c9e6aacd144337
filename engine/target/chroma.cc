#include "engine/target/chroma.h"

#include <algorithm>
#include <cmath>

#include "engine/core/color.h"
#include "engine/noise/noise_estimate.h"
#include "engine/target/bilateral.h"
#include "engine/target/curve_table.h"
#include "engine/target/float_image.h"
#include "engine/target/ycc.h"

namespace litags {
namespace {

constexpr double kBlur = 1.4;  // px; of the photo that the taps look at

// Deviation of the noise in the codes' luma.
double LumaNoise(const FloatImage& codes, const PlaneU8& mask) {
  FloatPlane luma(codes.size());
  for (int i = 0; i < codes.rows * codes.cols; ++i) luma(i) = Luma(codes(i));
  return NoiseOfChannel(luma[0], luma.cols, luma.rows, mask, kBelowWhite).Deviation() / 255;
}

}  // namespace

Photo SmoothChroma(const Photo& photo, double gain, double strength,
                   const std::function<double(double linear)>& curve, const PlaneU8& mask) {
  const FloatImage linear = LinearImage(photo);
  const CurveTable table(curve, 1 / gain);
  FloatImage codes = table(linear);
  const double noise = LumaNoise(codes, mask);
  if (strength > 0 && noise > kVisibleChromaNoise) {
    const FloatImage blurred = Blur(linear, kBlur);
    FloatImage guide = table(blurred);
    for (cv::Vec3f& pixel : guide) pixel = YccOfRgb(pixel);
    const auto hidden = static_cast<float>(noise / table.SlopeAtBlack());  // light
    const auto per_range = static_cast<float>(1 / (6 * std::pow(strength * noise, 2)));
    BilateralFilter filter(blurred, guide, mask, per_range);
    for (int y = 0; y < linear.rows; ++y) {
      const auto& means = filter.Row(y);
      for (int x = 0; x < linear.cols; ++x) {
        const cv::Vec3f color(means[0][x], means[1][x], means[2][x]);
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
