#include "engine/target/shadow_color.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/float_image.h"
#include "engine/target/information.h"

namespace litags {
namespace {

// Of squares of 2^i px against their parents of 2^(i + 1), measured on 110 well exposed photos: the
// deviation of Cb / Y and Cr / Y (linear light) is kFlat + kEdge |ln(Y / parent's Y)|. Of the
// largest, kFlat is the deviation from the capture's mean.
constexpr int kLevels = 9;
constexpr std::array<float, kLevels> kFlat = {.011f, .020f, .033f, .045f, .060f,
                                              .077f, .085f, .120f, .200f};
constexpr std::array<float, kLevels> kEdge = {.12f, .08f, .12f, .17f, .22f, .25f, .27f, .25f, 0};
constexpr float kMostEdge = 2;  // |ln|; beyond it colours differ no more

// Variance of Cb and Cr in square codes: rounding Cb itself and R, G and B before it makes
// (1 + 0.1687^2 + 0.3313^2 + 0.5^2) / 12 = 0.116. That is what one pixel has; the mean over a
// square has less, see kShares, measured on photos that were darkened with a sensor model.
constexpr float kRounding = 0.116f;
constexpr std::array<float, kLevels> kShares = {1.55f, 1.47f, 1.12f, 0.92f, 0.78f,
                                                0.69f, 0.56f, 0.43f, 0.43f};
// The errors of a square and of the squares that it lies in are mostly the same, so that several
// levels count as one observation. Choice, measured.
constexpr float kCorrelation = 4;

constexpr float kTiny = 1e-6f;

// Sums over a square, as means: Cb Y / s^2, Cr Y / s^2, Y^2 / s^2 and Y, all in linear light, where
// s is the light of one code. Cb / Y is the quotient of the first and the third, weighed by its
// precision.
using Sums = cv::Mat_<cv::Vec4f>;
// Estimates: Cb / Y, Cr / Y, variance.
using Estimates = cv::Mat_<cv::Vec3f>;

cv::Vec3f Ycc(const cv::Vec3f& rgb) {
  const float y = kLumaRed * rgb[0] + kLumaGreen * rgb[1] + kLumaBlue * rgb[2];
  return {y, (rgb[2] - y) / 1.772f, (rgb[0] - y) / 1.402f};
}

cv::Vec3f Rgb(const cv::Vec3f& ycc) {
  return {ycc[0] + 1.402f * ycc[2], ycc[0] - 0.344136f * ycc[1] - 0.714136f * ycc[2],
          ycc[0] + 1.772f * ycc[1]};
}

// sRGB encoding by a table over the root of the light; below black a line, as LinearTable has it.
class EncodeTable {
 public:
  static const EncodeTable& Get() {
    static const EncodeTable table;
    return table;
  }
  float operator()(float light) const {
    if (light <= 0.0031308f) return 12.92f * light;
    const float at = std::min(std::sqrt(light) * kScale, float(kSteps));
    const int i = static_cast<int>(at);
    return codes_[i] + (at - i) * (codes_[i + 1] - codes_[i]);
  }

 private:
  static constexpr int kSteps = 1 << 14;
  static constexpr float kScale = kSteps / 2.3f;
  EncodeTable() : codes_(kSteps + 2) {
    for (int i = 0; i < kSteps + 2; ++i) {
      codes_[i] = static_cast<float>(SrgbFromLinear(double(i) / kScale * i / kScale));
    }
  }
  std::vector<float> codes_;
};

// 1 / the light of one code squared, by the sample of the luma.
class PrecisionTable {
 public:
  static const PrecisionTable& Get() {
    static const PrecisionTable table;
    return table;
  }
  float operator()(float encoded) const {
    return values_[std::lrint(std::clamp(encoded, 0.0f, 1.0f) * kPhotoWhite)];
  }

 private:
  PrecisionTable() : values_(kPhotoWhite + 1) {
    for (int i = 0; i <= kPhotoWhite; ++i) {
      const double code = double(i) / kPhotoWhite;
      const double slope =
          code <= 0.04045 ? 1 / 12.92 : 2.4 / 1.055 * std::pow((code + 0.055) / 1.055, 1.4);
      values_[i] = static_cast<float>(std::pow(255 / slope, 2));
    }
  }
  std::vector<float> values_;
};

cv::Vec3f EncodedPixel(const Photo& photo, size_t i) {
  const int16_t* p = &photo.data[3 * i];
  return {EncodedOf(p[0]), EncodedOf(p[1]), EncodedOf(p[2])};
}

cv::Vec3f LinearPixel(const Photo& photo, size_t i) {
  const LinearTable& linear = LinearTable::Get();
  const int16_t* p = &photo.data[3 * i];
  return {linear(p[0]), linear(p[1]), linear(p[2])};
}

// A pixel's share of the sums.
cv::Vec4f SumsOf(const Photo& photo, size_t i) {
  const cv::Vec3f ycc = Ycc(LinearPixel(photo, i));
  const float y = std::max(ycc[0], 0.0f);
  const float weighed = y * PrecisionTable::Get()(Ycc(EncodedPixel(photo, i))[0]);
  return {ycc[1] * weighed, ycc[2] * weighed, y * weighed, y};
}

// Level 0 has one square per pixel. Masked pixels have a luma only.
std::vector<Sums> Pyramid(const Photo& photo, const PlaneU8& mask) {
  std::vector<Sums> levels(1, Sums(photo.height, photo.width));
  for (int i = 0; i < photo.height * photo.width; ++i) {
    cv::Vec4f sums = SumsOf(photo, i);
    if (!mask.empty() && mask.data[i] == 0) sums = {0, 0, 0, sums[3]};
    levels[0](i) = sums;
  }
  while (levels.size() < kLevels && std::min(levels.back().rows, levels.back().cols) > 1) {
    const Sums& fine = levels.back();
    Sums coarse;
    cv::resize(fine, coarse, cv::Size((fine.cols + 1) / 2, (fine.rows + 1) / 2), 0, 0,
               cv::INTER_AREA);
    levels.push_back(coarse);
  }
  return levels;
}

// Variance of Cb and Cr that a square of 2^level px has, in square codes.
float NoiseVariance(int level, double chroma_step) {
  // A DC coefficient is eight times the mean of 8x8 samples, of 16x16 px.
  const double dc = std::pow(chroma_step / 8, 2) / 12 / std::exp2(2 * std::max(0, level - 4));
  return kCorrelation * (kRounding * kShares[level] + static_cast<float>(dc));
}

// The posterior of a square from its parent's, whose variance of colour about it was added.
cv::Vec3f Update(const cv::Vec3f& prior, const cv::Vec4f& sums, float noise) {
  // Share of the observation: v / (v + noise / power), also where there is no power at all.
  const float share = prior[2] * sums[2] / (prior[2] * sums[2] + noise);
  const float per_power = 1 / (sums[2] + kTiny);
  return {prior[0] + share * (sums[0] * per_power - prior[0]),
          prior[1] + share * (sums[1] * per_power - prior[1]), prior[2] * (1 - share)};
}

// Colours of the pixels, from the largest squares to the smallest.
Estimates InferRatios(const std::vector<Sums>& levels, const ColorPrior& prior) {
  int level = static_cast<int>(levels.size()) - 1;
  const float root = std::pow(kFlat[kLevels - 1], 2);
  Estimates estimates(levels[level].size());
  for (int i = 0; i < estimates.rows * estimates.cols; ++i) {
    estimates(i) = Update(cv::Vec3f(prior.cb, prior.cr, root), levels[level](i),
                          NoiseVariance(level, prior.chroma_step));
  }
  while (--level >= 0) {
    const Sums& sums = levels[level];
    const float noise = NoiseVariance(level, prior.chroma_step);
    Estimates parents;
    cv::resize(estimates, parents, sums.size(), 0, 0, cv::INTER_LINEAR);
    FloatPlane coarse_luma, luma;
    cv::extractChannel(levels[level + 1], coarse_luma, 3);
    cv::resize(coarse_luma, luma, sums.size(), 0, 0, cv::INTER_LINEAR);
    estimates.create(sums.size());
    for (int i = 0; i < sums.rows * sums.cols; ++i) {
      const float edge = std::abs(std::log((sums(i)[3] + kTiny) / (luma(i) + kTiny)));
      const float deviation = kFlat[level] + kEdge[level] * std::min(edge, kMostEdge);
      cv::Vec3f from = parents(i);
      from[2] += deviation * deviation;
      estimates(i) = Update(from, sums(i), noise);
    }
  }
  return estimates;
}

// Step 1, see the header.
Photo CorrectRounding(const Photo& photo, const RoundingTable& table) {
  Photo out = photo;
  for (int i = 0; i < photo.height * photo.width; ++i) {
    const cv::Vec3f rgb = EncodedPixel(photo, i);
    const cv::Vec3f ycc = Ycc(rgb) * 255.0f;
    if (ycc[0] >= RoundingTable::kTop) continue;
    const std::array<float, 3> mean = table.Correction({ycc[0], ycc[1], ycc[2]});
    const cv::Vec3f add = Rgb({mean[0], mean[1], mean[2]}) * (1.0f / 255);
    for (int c = 0; c < 3; ++c) out.data[3 * size_t(i) + c] = PhotoSample(rgb[c] + add[c]);
  }
  return out;
}

// Deviation of a photo's luma in its dark parts, codes; flat areas set it, not edges.
double DarkNoise(const Photo& photo, const PlaneU8& mask) {
  constexpr float kFrom = 0.5f, kTo = 12;  // codes
  std::vector<float> differences;
  const auto luma = [&](int x, int y) {
    return 255 * Ycc(EncodedPixel(photo, size_t(y) * photo.width + x))[0];
  };
  for (int y = 1; y + 1 < photo.height; y += 2) {
    for (int x = 1; x + 1 < photo.width; x += 2) {
      const float middle = luma(x, y);
      if (middle < kFrom || middle > kTo || !Counts(mask, x, y)) continue;
      const float around = luma(x - 1, y) + luma(x + 1, y) + luma(x, y - 1) + luma(x, y + 1);
      differences.push_back(std::abs(middle - around / 4));
    }
  }
  if (differences.empty()) return 0;
  const auto quartile = differences.begin() + differences.size() / 4;
  std::nth_element(differences.begin(), quartile, differences.end());
  return NoiseOfDifferences(*quartile);
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

ColorPrior MeasureColorPrior(const Photo& photo, double chroma_step, const PlaneU8& mask) {
  // A JPEG takes noise of less than its steps away, so what is measured is a lower bound. Choice
  constexpr double kLeastNoise = 0.1;
  constexpr double kChannelOfLuma = 1.5;  // a channel's noise over the luma's, if independent
  constexpr int16_t kClipped = kPhotoWhite * 0.98;  // a clipped colour is not the light's
  ColorPrior prior;
  prior.jpeg = chroma_step > 0;
  prior.chroma_step = chroma_step;
  prior.noise = std::max(kLeastNoise, kChannelOfLuma * DarkNoise(photo, mask));
  cv::Vec3d total(0, 0, 0);  // Cb Y, Cr Y, Y Y, weighed as in Sums
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    const int16_t* p = &photo.data[3 * i];
    if (std::max({p[0], p[1], p[2]}) >= kClipped) return;
    const cv::Vec4f sums = SumsOf(photo, i);
    total += cv::Vec3d(sums[0], sums[1], sums[2]);
  });
  if (total[2] > 0) {
    prior.cb = total[0] / total[2];
    prior.cr = total[1] / total[2];
  }
  return prior;
}

ColorPrior MedianPrior(absl::Span<const ColorPrior> priors) {
  if (priors.empty()) return {};
  const auto median = [&](double ColorPrior::*field) {
    std::vector<double> values;
    for (const ColorPrior& prior : priors) values.push_back(prior.*field);
    return Median(std::move(values));
  };
  ColorPrior out = {median(&ColorPrior::cb), median(&ColorPrior::cr), median(&ColorPrior::noise)};
  out.jpeg = false;
  for (const ColorPrior& prior : priors) {
    out.jpeg |= prior.jpeg;
    out.chroma_step = std::max(out.chroma_step, prior.chroma_step);
  }
  return out;
}

Photo ShadowColors::Infer(const Photo& photo, const PlaneU8& mask) const {
  const Photo corrected = CorrectRounding(photo, rounding_);
  const Estimates ratios = InferRatios(Pyramid(corrected, mask), prior_);
  Photo out = corrected;
  for (int i = 0; i < photo.height * photo.width; ++i) {
    const cv::Vec3f encoded = EncodedPixel(corrected, i);
    const float code = 255 * Ycc(encoded)[0];
    if (code >= kShadowTop) continue;
    const float share = 1 - SmoothStep(2 * code / kShadowTop - 1);
    const float y = Ycc(LinearPixel(corrected, i))[0];
    const float positive = std::max(y, 0.0f);
    const cv::Vec3f inferred = Rgb({y, positive * ratios(i)[0], positive * ratios(i)[1]});
    for (int c = 0; c < 3; ++c) {
      const float now = EncodeTable::Get()(inferred[c]);
      out.data[3 * size_t(i) + c] = PhotoSample(encoded[c] + share * (now - encoded[c]));
    }
  }
  return out;
}

}  // namespace litags
