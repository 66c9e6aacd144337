#include "engine/target/jpeg_chroma.h"

#include <algorithm>
#include <cmath>

#include "engine/target/ycc.h"

namespace litags {
namespace {

constexpr int kMostCode = 32;                         // of R, G and B that the table holds
constexpr float kParts[] = {-1 / 3.0f, 0, 1 / 3.0f};  // of a code, where its colours are tried
// Of Cb / Y and Cr / Y in linear light, pixels of 110 well exposed photos.
constexpr double kDeviation = 0.37;
constexpr float kHalf = 0.5f - 1e-4f;  // almost halves are halves, in 16 bits

// Of a colour over R, G and B: normal over Cb / Y and Cr / Y.
double Likelihood(const cv::Vec3f& ycc, const cv::Vec2f& mean) {
  const double cb = ycc[1] / ycc[0] - mean[0], cr = ycc[2] / ycc[0] - mean[1];
  return std::exp(-(cb * cb + cr * cr) / (2 * kDeviation * kDeviation)) / (ycc[0] * ycc[0]);
}

// The likelihood of the colours that round to R, G and B, and Cb and Cr times it.
cv::Vec3d SumsOfCode(int r, int g, int b, const cv::Vec2f& mean) {
  cv::Vec3d sums(0, 0, 0);
  for (const float dr : kParts) {
    for (const float dg : kParts) {
      for (const float db : kParts) {
        if (r + dr < 0 || g + dg < 0 || b + db < 0) continue;
        const cv::Vec3f ycc = YccOfRgb({r + dr, g + dg, b + db});
        if (ycc[0] > 0) sums += Likelihood(ycc, mean) * cv::Vec3d(1, ycc[1], ycc[2]);
      }
    }
  }
  return sums;
}

// The table's entries beside x, from 0 to most, and how far x is from the lower one.
struct Between {
  Between(float x, int most)
      : low(std::clamp(static_cast<int>(x), 0, most - 1)), t(std::clamp(x - low, 0.0f, 1.0f)) {}

  int low;
  float t;
};

cv::Vec2f Mix(float t, const cv::Vec2f& low, const cv::Vec2f& high) {
  return (1 - t) * low + t * high;
}

}  // namespace

JpegChroma::JpegChroma(const cv::Vec2f& mean) : lost_() {
  std::array<std::array<std::array<cv::Vec3d, kChromas>, kChromas>, kDarkCodes> sums = {};
  for (int r = 0; r < kMostCode; ++r) {
    for (int g = 0; g < kMostCode; ++g) {
      for (int b = 0; b < kMostCode; ++b) {
        const cv::Vec3f ycc = YccOfRgb(cv::Vec3f(r, g, b));
        const int y = static_cast<int>(std::floor(ycc[0] + 0.5f));
        const int cb = static_cast<int>(std::floor(ycc[1] + kHalf)) + kMostChroma;
        const int cr = static_cast<int>(std::floor(ycc[2] + kHalf)) + kMostChroma;
        if (y >= kDarkCodes || std::min(cb, cr) < 0 || std::max(cb, cr) >= kChromas) continue;
        sums[y][cb][cr] += SumsOfCode(r, g, b, mean);
      }
    }
  }
  for (int y = 0; y < kDarkCodes; ++y) {
    for (int cb = 0; cb < kChromas; ++cb) {
      for (int cr = 0; cr < kChromas; ++cr) {
        const cv::Vec3d& sum = sums[y][cb][cr];
        if (sum[0] <= 0) continue;  // no colour becomes this code
        lost_[y][cb][cr] =
            cv::Vec2f(sum[1] / sum[0] - (cb - kMostChroma), sum[2] / sum[0] - (cr - kMostChroma));
      }
    }
  }
}

cv::Vec2f JpegChroma::Lost(const cv::Vec3f& codes) const {
  const Between y(codes[0], kDarkCodes);
  const Between cb(codes[1] + kMostChroma, kChromas - 1);
  const Between cr(codes[2] + kMostChroma, kChromas - 1);
  const auto row = [&](const Row& r) { return Mix(cr.t, r[cr.low], r[cr.low + 1]); };
  const auto plane = [&](const Plane& p) { return Mix(cb.t, row(p[cb.low]), row(p[cb.low + 1])); };
  return Mix(y.t, plane(lost_[y.low]), plane(lost_[y.low + 1]));
}

}  // namespace litags
