#include "engine/target/highlights.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/target/curve_table.h"
#include "engine/target/float_image.h"

namespace litags {
namespace {

// Of the photo's shorter side, whichever way the camera was held: as shares of the longer one they
// cost fox 0.2 dB and fox_style 0.4. Choices, measured
constexpr double kColorSigma = 0.01;  // how far estimated colours are averaged
constexpr double kNearSigma = 0.04;   // how far a gradual border is felt
constexpr double kFarSigma = 0.2;     // how far around borders are looked at to tell a light

// Mean codes between which a pixel becomes one that is nearly clipped. Choice, measured
constexpr float kBright = 0.8f, kBrightest = 0.95f;
constexpr float kShareOfLight = 0.8f;  // least ClippedShare far around a light. Choice, measured
constexpr float kLeast = 1e-3f;        // weight of a pixel or channel that has no other

int ShorterSide(const FloatImage& image) { return std::min(image.cols, image.rows); }

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
  const double sigma = kColorSigma * ShorterSide(codes);
  out = Blur(out, sigma);
  weights = Blur(weights, sigma);
  for (int i = 0; i < codes.rows * codes.cols; ++i) out(i) *= 1 / weights(i);
  cv::exp(out, out);
  return out;
}

// Blur() by so many pixels that a smaller picture does as well.
FloatPlane BlurFar(const FloatPlane& plane, double sigma) {
  const int step = std::max(1, static_cast<int>(sigma / 4));
  const cv::Size size((plane.cols + step - 1) / step, (plane.rows + step - 1) / step);
  FloatPlane small, out;
  cv::resize(plane, small, size, 0, 0, cv::INTER_AREA);
  cv::resize(Blur(small, sigma / step), out, plane.size(), 0, 0, cv::INTER_LINEAR);
  return out;
}

// Which part of what is `bright` around each pixel is clipped in all channels, [0, 1]. Borders to
// what is dark do not count: something else begins there.
FloatPlane ClippedShare(const FloatPlane& all, const FloatPlane& bright, double sigma) {
  FloatPlane share = BlurFar(all, sigma);
  const FloatPlane of = BlurFar(bright, sigma);
  for (int i = 0; i < share.rows * share.cols; ++i) {
    share(i) = std::min(share(i) / std::max(of(i), kLeast), 1.0f);
  }
  return share;
}

// How far each pixel is into areas where all channels are clipped, and whether they are lights.
struct Glare {
  FloatPlane inside;  // 0: not all channels are clipped, 1: nothing but glare around
  FloatPlane light;   // 0: a surface that is bright in places, 1: a lamp or the sky
};

Glare FindGlare(const FloatImage& codes, const FloatImage& clipped) {
  FloatPlane all(codes.size()), bright(codes.size());
  for (int i = 0; i < codes.rows * codes.cols; ++i) {
    const cv::Vec3f &c = codes(i), &t = clipped(i);
    all(i) = t[0] * t[1] * t[2];
    bright(i) =
        std::max(all(i), SmoothStep(((c[0] + c[1] + c[2]) / 3 - kBright) / (kBrightest - kBright)));
  }
  Glare glare = {ClippedShare(all, bright, kNearSigma * ShorterSide(codes)),
                 ClippedShare(all, bright, kFarSigma * ShorterSide(codes))};
  cv::multiply(glare.inside, all, glare.inside);
  for (float& share : glare.light) {
    share = std::max(0.0f, (share - kShareOfLight) / (1 - kShareOfLight));
  }
  return glare;
}

}  // namespace

Photo FillHighlights(const Photo& photo, double gain, const ClippedColors& colors,
                     const std::function<double(double linear)>& curve,
                     const Brightening& brightened) {
  const FloatImage codes = SmoothCodes(brightened.Undone(photo)), linear = LinearImage(photo);
  const FloatImage clipped = ClippednessOf(codes), color = Colors(codes, clipped, colors);
  const Glare glare = FindGlare(codes, clipped);
  const CurveTable table(curve, 1 / gain);
  const auto white = static_cast<float>(1 / gain);
  Photo out(photo.width, photo.height);
  for (int i = 0; i < photo.height * photo.width; ++i) {
    const float inside = glare.inside(i);
    const float fill = inside * (kSurfaceFill + kLightFill * glare.light(i));
    const std::array<float, 3> grew = brightened.At(i % photo.width, i / photo.width);
    // White towards the middle: what blinds a camera is mostly light, not colour.
    const cv::Vec3f k = cv::Vec3f(1, 1, 1) + (1 - inside) * (color(i) - cv::Vec3f(1, 1, 1));
    const cv::Vec3f &y = linear(i), &t = clipped(i);
    float measured = 0, of_color = 0;
    for (int c = 0; c < 3; ++c) {
      measured += (1 - t[c] + kLeast) * y[c] / grew[c];
      of_color += (1 - t[c] + kLeast) * k[c];
    }
    const float brightness = measured / of_color;
    for (int c = 0; c < 3; ++c) {
      const float estimate = std::max(y[c], std::min(grew[c] * k[c] * brightness, white));
      const float lift = (1 - table(grew[c])) * fill;
      const float code = table(y[c] + (estimate - y[c]) * t[c]) + lift;
      out.data[3 * i + c] = PhotoSample(std::min(code, 1.0f));
    }
  }
  return out;
}

}  // namespace litags
