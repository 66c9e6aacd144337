#include "engine/target/rounding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "engine/core/color.h"
#include "engine/target/float_image.h"

namespace litags {
namespace {

constexpr float kStep = 0.25f;  // codes, of the table
constexpr int kLumas = 57;      // cells of Y, 0 to 14 codes
constexpr int kChromas = 57;    // cells of Cb and of Cr, -7 to 7 codes
constexpr float kFadeFrom = 9;  // codes
// Colours of well exposed photos deviate by 0.20 of their luma from the photo's mean where 256 px
// are averaged, and by 0.18 more within. Measured on 110 photos.
constexpr double kDeviation = 0.27;
constexpr double kDarkest = 0.05, kBrightest = 24;  // codes
// Codes are looked up with a normal kernel: a pixel of a decoded photo is a mean of integers.
constexpr double kKernel = 0.25;
constexpr int kColors = 300000;
constexpr int kDraws = 8;  // of the noise, per colour

using Codes = std::array<int, 3>;

// libjpeg's conversion (jccolor.c), in its integers: halves of Cb and Cr are rounded down.
Codes JpegYcc(const Codes& rgb) {
  constexpr auto kFix = [](double x) { return static_cast<int>(x * 65536 + 0.5); };
  constexpr int kHalf = 1 << 15, kCentre = 128 << 16;
  const auto& [r, g, b] = rgb;
  return {(kFix(0.299) * r + kFix(0.587) * g + kFix(0.114) * b + kHalf) >> 16,
          ((-kFix(0.168735892) * r - kFix(0.331264108) * g + kFix(0.5) * b + kCentre + kHalf - 1) >>
           16) -
              128,
          ((kFix(0.5) * r - kFix(0.418687589) * g - kFix(0.081312411) * b + kCentre + kHalf - 1) >>
           16) -
              128};
}

cv::Vec3f Ycc(const cv::Vec3f& rgb) {
  const float y = kLumaRed * rgb[0] + kLumaGreen * rgb[1] + kLumaBlue * rgb[2];
  return {y, (rgb[2] - y) / 1.772f, (rgb[0] - y) / 1.402f};
}

// Code of sRGB, 0 to 255, of light in codes of the curve's straight part.
float CodeOf(double light) {
  return static_cast<float>(255 * SrgbFromLinear(light / (255 * 12.92)));
}

// The middles of kDraws equal parts of a normal distribution.
constexpr std::array<float, kDraws> kNormals = {-1.534f, -0.887f, -0.489f, -0.157f,
                                                0.157f,  0.489f,  0.887f,  1.534f};

// The mean of what the encoder makes of a colour with noise, Y, Cb, Cr.
cv::Vec3f Rounded(const cv::Vec3f& rgb, const ColorPrior& prior) {
  constexpr std::array<int, 3> kStride = {1, 3, 5}, kStart = {0, 1, 2};  // three permutations
  cv::Vec3f sum(0, 0, 0);
  const auto noise = static_cast<float>(prior.noise);
  for (int draw = 0; draw < kDraws; ++draw) {
    Codes codes;
    for (int c = 0; c < 3; ++c) {
      const float normal = kNormals[(kStride[c] * draw + kStart[c]) % kDraws];
      codes[c] = static_cast<int>(std::lrint(std::clamp(rgb[c] + noise * normal, 0.0f, 255.0f)));
    }
    if (prior.jpeg) {
      const Codes ycc = JpegYcc(codes);
      sum += cv::Vec3f(ycc[0], ycc[1], ycc[2]);
    } else {
      sum += Ycc(cv::Vec3f(codes[0], codes[1], codes[2]));
    }
  }
  return sum * (1.0f / kDraws);
}

// Point i of a sequence that fills the unit cube evenly (Roberts' R3).
std::array<double, 3> EvenPoint(int i) {
  constexpr std::array<double, 3> kAlpha = {0.8191725133961645, 0.6710436067037893,
                                            0.5497004779019703};
  std::array<double, 3> point;
  for (int d = 0; d < 3; ++d) {
    const double x = 0.5 + kAlpha[d] * (i + 1.0);
    point[d] = x - std::floor(x);
  }
  return point;
}

int CellOf(int y, int cb, int cr) { return (y * kChromas + cb) * kChromas + cr; }

// Smooths along one axis whose neighbours are `stride` cells apart.
void SmoothAxis(std::vector<cv::Vec4f>* cells, int stride, int size, double sigma) {
  const int radius = static_cast<int>(std::ceil(5 * sigma));
  std::vector<float> weights(radius + 1);
  for (int i = 0; i <= radius; ++i) weights[i] = std::exp(-0.5 * std::pow(i / sigma, 2));
  std::vector<cv::Vec4f> line(size);
  for (size_t start = 0; start < cells->size(); ++start) {
    if (start / stride % size != 0) continue;
    for (int i = 0; i < size; ++i) {
      line[i] = cv::Vec4f::all(0);
      for (int j = std::max(0, i - radius); j <= std::min(size - 1, i + radius); ++j) {
        line[i] += weights[std::abs(i - j)] * (*cells)[start + size_t(j) * stride];
      }
    }
    for (int i = 0; i < size; ++i) (*cells)[start + size_t(i) * stride] = line[i];
  }
}

// Adds what a colour differs from its code by, and a count of 1, to the code's cell.
void AddColor(int i, const ColorPrior& prior, std::vector<cv::Vec4f>* cells) {
  const std::array<double, 3> u = EvenPoint(i);
  const double y = kDarkest * std::pow(kBrightest / kDarkest, u[0]);
  const double radius = kDeviation * std::sqrt(-2 * std::log(std::max(u[1], 1e-12)));
  const double cb = y * (prior.cb + radius * std::cos(2 * std::numbers::pi * u[2]));
  const double cr = y * (prior.cr + radius * std::sin(2 * std::numbers::pi * u[2]));
  const std::array<double, 3> light = {
      y + 1.402 * cr, y - (0.114 * 1.772 * cb + 0.299 * 1.402 * cr) / 0.587, y + 1.772 * cb};
  if (std::min({light[0], light[1], light[2]}) < 0) return;
  const cv::Vec3f rgb(CodeOf(light[0]), CodeOf(light[1]), CodeOf(light[2]));
  const cv::Vec3f code = Rounded(rgb, prior);
  const long row = std::lrint(code[0] / kStep), column = std::lrint(code[1] / kStep) + kChromas / 2,
             plane = std::lrint(code[2] / kStep) + kChromas / 2;
  if (row >= kLumas || column < 0 || column >= kChromas || plane < 0 || plane >= kChromas) return;
  const cv::Vec3f off = Ycc(rgb) - code;
  (*cells)[CellOf(row, column, plane)] += cv::Vec4f(off[0], off[1], off[2], 1);
}

}  // namespace

RoundingTable::RoundingTable(const ColorPrior& prior) {
  std::vector<cv::Vec4f> sums(size_t(kLumas) * kChromas * kChromas, cv::Vec4f::all(0));
  for (int i = 0; i < kColors; ++i) AddColor(i, prior, &sums);
  SmoothAxis(&sums, 1, kChromas, kKernel / kStep);
  SmoothAxis(&sums, kChromas, kChromas, kKernel / kStep);
  SmoothAxis(&sums, kChromas * kChromas, kLumas, kKernel / kStep);
  constexpr float kNone = 1e-4f;  // count, where no colour arrives
  cells_.reserve(sums.size());
  for (const cv::Vec4f& s : sums)
    cells_.push_back({s[0] / (s[3] + kNone), s[1] / (s[3] + kNone), s[2] / (s[3] + kNone)});
}

std::array<float, 3> RoundingTable::Correction(const std::array<float, 3>& ycc) const {
  if (ycc[0] >= kTop) return {0, 0, 0};
  const float at[3] = {std::clamp(ycc[0] / kStep, 0.0f, kLumas - 1.001f),
                       std::clamp(ycc[1] / kStep + kChromas / 2, 0.0f, kChromas - 1.001f),
                       std::clamp(ycc[2] / kStep + kChromas / 2, 0.0f, kChromas - 1.001f)};
  const int y = static_cast<int>(at[0]), cb = static_cast<int>(at[1]), cr = static_cast<int>(at[2]);
  const float fy = at[0] - y, fcb = at[1] - cb, fcr = at[2] - cr;
  const auto line = [&](int row, int column) {
    const auto* cell = &cells_[CellOf(row, column, cr)];
    const cv::Vec3f near(cell[0].data()), far(cell[1].data());
    return cv::Vec3f(near + fcr * (far - near));
  };
  const auto plane = [&](int row) {
    const cv::Vec3f near = line(row, cb);
    return cv::Vec3f(near + fcb * (line(row, cb + 1) - near));
  };
  const cv::Vec3f below = plane(y);
  const float fade = 1 - SmoothStep((ycc[0] - kFadeFrom) / (kTop - kFadeFrom));
  const cv::Vec3f mean = fade * (below + fy * (plane(y + 1) - below));
  return {mean[0], mean[1], mean[2]};
}

}  // namespace litags
