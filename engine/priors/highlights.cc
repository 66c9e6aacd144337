#include "engine/priors/highlights.h"

#include <algorithm>
#include <cmath>

#include "engine/priors/float_image.h"

namespace litags {
namespace {

constexpr double kFadeSigma = 0.04;   // of the photo's width: how far white takes to be reached
constexpr double kColorSigma = 0.01;  // of the width: how far estimated colours are averaged
constexpr float kLeast = 1e-3f;       // weight of a pixel or channel that has no other

// Per channel: 0 measured, 1 clipped.
FloatImage ClippednessOf(const FloatImage& codes) {
  FloatImage out = codes.clone();
  for (cv::Vec3f& pixel : out) {
    for (int c = 0; c < 3; ++c) pixel[c] = Clippedness(pixel[c]);
  }
  return out;
}

// Each pixel's ratio of channels to their mean, averaged over neighbours with some channels
// clipped: what varies from pixel to pixel is brightness rather than colour.
FloatImage Colors(const FloatImage& codes, const FloatImage& clipped, const ClippedColors& colors) {
  FloatImage out(codes.size());
  FloatPlane weights(codes.size());
  for (int i = 0; i < codes.rows * codes.cols; ++i) {
    const cv::Vec3f& t = clipped(i);
    weights(i) = std::max({t[0], t[1], t[2]}) * (1 - t[0] * t[1] * t[2]) + kLeast;
    const Rgb ratio = colors.LogRatio({codes(i)[0], codes(i)[1], codes(i)[2]});
    out(i) = weights(i) * cv::Vec3f(ratio.data());
  }
  out = Blur(out, kColorSigma * codes.cols);
  weights = Blur(weights, kColorSigma * codes.cols);
  for (int i = 0; i < codes.rows * codes.cols; ++i) out(i) *= 1 / weights(i);
  cv::exp(out, out);
  return out;
}

}  // namespace

ImageU8 FillHighlights(const ImageU8& photo, double gain, const ClippedColors& colors,
                       const std::function<double(double linear)>& curve) {
  const FloatImage codes = SmoothCodes(photo), linear = LinearImage(photo);
  const FloatImage clipped = ClippednessOf(codes), color = Colors(codes, clipped, colors);
  FloatPlane all(photo.height, photo.width);
  for (int i = 0; i < photo.height * photo.width; ++i) {
    all(i) = clipped(i)[0] * clipped(i)[1] * clipped(i)[2];
  }
  const FloatPlane depth = Blur(all, kFadeSigma * photo.width);  // into the clipped area, [0, 1]
  const double lift = kHighlightFill * (1 - curve(1));
  ImageU8 out(photo.width, photo.height);
  for (int i = 0; i < photo.height * photo.width; ++i) {
    const float inside = all(i) * depth(i);
    // White towards the middle: what blinds a camera is mostly light, not colour.
    const cv::Vec3f k = cv::Vec3f(1, 1, 1) + (1 - inside) * (color(i) - cv::Vec3f(1, 1, 1));
    const cv::Vec3f &y = linear(i), &t = clipped(i);
    float measured = 0, of_color = 0;
    for (int c = 0; c < 3; ++c) {
      measured += (1 - t[c] + kLeast) * y[c];
      of_color += (1 - t[c] + kLeast) * k[c];
    }
    const float brightness = measured / of_color;
    for (int c = 0; c < 3; ++c) {
      const double estimate = std::max<double>(y[c], std::min<double>(k[c] * brightness, 1 / gain));
      const double code = curve(y[c] + (estimate - y[c]) * t[c]) + inside * lift;
      out.data[3 * i + c] = static_cast<uint8_t>(std::lround(255 * std::clamp(code, 0.0, 1.0)));
    }
  }
  return out;
}

}  // namespace litags
