#include "engine/priors/highlights.h"

#include <algorithm>
#include <cmath>

#include "engine/priors/float_image.h"

namespace litags {
namespace {

// Codes between which a sample turns from measured to clipped: noise and compression scatter
// clipped samples below 255.
constexpr double kKnee = 0.95, kTop = 0.995;
constexpr double kCodeSigma = 0.0015;   // of the photo's width: codes are smoothed before the knee
constexpr double kSurroundings = 0.04;  // of the width: sigma of "around here"
constexpr double kLeast = 1e-3;  // weight of a clipped channel, and of the photo's mean colour

// Per channel: 0 measured, 1 clipped.
FloatImage Clippedness(const ImageU8& photo) {
  const cv::Mat codes(photo.height, photo.width, CV_8UC3, const_cast<uint8_t*>(photo.data.data()));
  FloatImage scaled;
  codes.convertTo(scaled, CV_32FC3, 1.0 / 255);
  FloatImage t = Blur(scaled, std::max(0.5, kCodeSigma * photo.width));
  for (cv::Vec3f& pixel : t) {
    for (int c = 0; c < 3; ++c) {
      const float x = std::clamp((pixel[c] - float(kKnee)) / float(kTop - kKnee), 0.0f, 1.0f);
      pixel[c] = x * x * (3 - 2 * x);
    }
  }
  return t;
}

float Sum(const cv::Vec3f& v) { return v[0] + v[1] + v[2]; }

// Colour of the unclipped surroundings, channels with a mean of 1. Brighter pixels count more:
// they are the likelier relatives of the clipped ones.
FloatImage SurroundingColor(const FloatImage& linear, const FloatImage& clipped) {
  FloatImage weighted(linear.size());
  cv::Vec3d sum(0, 0, 0);
  for (int i = 0; i < linear.rows * linear.cols; ++i) {
    const cv::Vec3f &y = linear(i), &t = clipped(i);
    const float mean = Sum(y) / 3, square = mean * mean;
    weighted(i) = (1 - t[0]) * (1 - t[1]) * (1 - t[2]) * square * square * y;
    sum += cv::Vec3d(weighted(i));
  }
  const cv::Vec3f everywhere = sum * (kLeast / (linear.rows * linear.cols));
  FloatImage color = Blur(weighted, kSurroundings * linear.cols);
  for (cv::Vec3f& k : color) {
    k += everywhere;
    const float mean = Sum(k) / 3;
    k = mean > 0 ? k * (1 / mean) : cv::Vec3f(1, 1, 1);
  }
  return color;
}

}  // namespace

ImageU8 FillHighlights(const ImageU8& photo, double gain,
                       const std::function<double(double linear)>& curve) {
  const FloatImage clipped = Clippedness(photo), linear = LinearImage(photo);
  const FloatImage color = SurroundingColor(linear, clipped);
  FloatPlane all(photo.height, photo.width);
  for (int i = 0; i < photo.height * photo.width; ++i) {
    all(i) = clipped(i)[0] * clipped(i)[1] * clipped(i)[2];
  }
  const FloatPlane depth = Blur(all, kSurroundings * photo.width);  // into the clipped area, [0, 1]
  const double lift = kHighlightFill * (1 - curve(1));
  ImageU8 out(photo.width, photo.height);
  for (int i = 0; i < photo.height * photo.width; ++i) {
    const float inside = all(i) * depth(i);
    // White towards the middle: what blinds a camera is mostly light, not colour.
    const cv::Vec3f k = cv::Vec3f(1, 1, 1) + (1 - inside) * (color(i) - cv::Vec3f(1, 1, 1));
    const cv::Vec3f &y = linear(i), &t = clipped(i);
    float measured = 0, of_color = 0;
    for (int c = 0; c < 3; ++c) {
      measured += (1 - t[c] + float(kLeast)) * y[c];
      of_color += (1 - t[c] + float(kLeast)) * k[c];
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
