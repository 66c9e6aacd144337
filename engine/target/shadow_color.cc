#include "engine/target/shadow_color.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "engine/core/mask.h"
#include "engine/core/quantile.h"
#include "engine/noise/noise_estimate.h"
#include "engine/target/float_image.h"
#include "engine/target/jpeg_chroma.h"
#include "engine/target/ycc.h"

namespace litags {
namespace {

// Of squares of 2^i px against their parents of 2^(i + 1), measured on 110 well exposed photos: the
// deviation of Cb / Y and Cr / Y (linear light) is kFlat + kEdge |ln(Y / parent's Y)|. Of the
// largest, kFlat is the deviation from the capture's mean.
constexpr int kLevels = 9;
constexpr std::array<float, kLevels> kFlat = {.007f, .013f, .021f, .029f, .039f,
                                              .052f, .062f, .094f, .184f};
constexpr std::array<float, kLevels> kEdge = {.105f, .070f, .090f, .115f, .130f,
                                              .140f, .155f, .185f, 0};
constexpr float kMostEdge = 2;  // |ln|; beyond it colours differ no more

// Variance of Cb and Cr in square steps of the file: rounding Cb itself and R, G and B before it
// makes (1 + 0.1687^2 + 0.3313^2 + 0.5^2) / 12 = 0.116. That is what one pixel has; the mean over a
// square has less, see kShares, measured on photos that were darkened with a sensor model without
// noise. Noise makes rounding errors independent of each other, see NoiseVariance.
constexpr float kRounding = 0.116f;
constexpr std::array<float, kLevels> kShares = {1.55f, 1.47f, 1.12f, 0.92f, 0.78f,
                                                0.69f, 0.56f, 0.43f, 0.43f};
// The errors of a square and of the squares that it lies in are mostly the same, so that several
// levels count as one observation. Choice, see docs/experiments/shadow-color.md.
constexpr float kCorrelation = 2;

// Of independent noise in R, G and B: its variance in luma, and in Cb and Cr (the mean of 0.388 and
// 0.432), weights of ITU-R BT.601.
constexpr double kNoiseOfLuma = 0.447, kNoiseOfChroma = 0.41;

constexpr float kTiny = 1e-6f;

// Sums over a square, as means: Cb Z / s^2, Cr Z / s^2, Y Z / s^2 and Y, all in linear light, where
// Z is the mean luma around the pixel and s the light of one code there. Cb / Y is the quotient of
// the first and the third, weighed by its precision. Weights by the pixel's own luma would take its
// noise for light, squared: dark colours would fade to grey.
using Sums = cv::Mat_<cv::Vec4f>;
// Estimates: Cb / Y, Cr / Y, their variance, and Y of the square.
using Estimates = cv::Mat_<cv::Vec4f>;

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

constexpr int kAround = 5;  // px, the side of the square that Z is the mean of. Choice

// Of R, G and B, in square codes.
double SensorVariance(const ColorPrior& prior) {
  return prior.luma_noise * prior.luma_noise / kNoiseOfLuma;
}

// How much of the errors of rounding is the same from pixel to pixel: rounding a value with normal
// noise has an error whose mean varies, from value to value, with exp(-4 pi^2 variance) of the
// variance that it has without noise (the first harmonic of the quantiser's error; the variance in
// square steps).
double AlikeRounding(const ColorPrior& prior) {
  const double step = prior.steps.code;
  return std::exp(-4 * std::numbers::pi * std::numbers::pi * SensorVariance(prior) / (step * step));
}

// What a pixel's sums need of the pixels around it.
struct Weights {
  FloatPlane power;          // Z / s^2
  cv::Mat_<cv::Vec2f> lost;  // by JPEG (JpegChroma), of Cb Z / s^2 and Cr Z / s^2
};

cv::Mat Around(const cv::Mat& image) {
  cv::Mat out;
  cv::blur(image, out, cv::Size(kAround, kAround), cv::Point(-1, -1), cv::BORDER_REPLICATE);
  return out;
}

Weights WeightsOf(const Photo& photo, const ColorPrior& prior, const JpegChroma& chroma) {
  const float alike = prior.steps.chroma > 0 ? static_cast<float>(AlikeRounding(prior)) : 0;
  FloatPlane luma(photo.height, photo.width);
  FloatImage codes;
  if (alike > 0) codes.create(photo.height, photo.width);
  for (size_t i = 0; i < photo.pixels(); ++i) {
    luma(static_cast<int>(i)) = YccOfRgb(LinearPixel(photo, i))[0];
    if (alike > 0) codes(static_cast<int>(i)) = 255 * YccOfRgb(EncodedPixel(photo, i));
  }
  Weights out = {.power = Around(luma),
                 .lost = cv::Mat_<cv::Vec2f>(photo.height, photo.width, cv::Vec2f(0, 0))};
  if (alike > 0) codes = Around(codes);
  const PrecisionTable& precision = PrecisionTable::Get();
  const SampleTable& sample = SampleTable::Get();
  for (int i = 0; i < static_cast<int>(photo.pixels()); ++i) {
    float& z = out.power(i);
    z = std::max(z, 0.0f);
    const float per_code = precision(EncodedOf(sample(z)));
    if (alike > 0) out.lost(i) = alike * z * std::sqrt(per_code) * chroma.Lost(codes(i));
    z *= per_code;
  }
  return out;
}

// A pixel's sums, at level 0. Masked pixels have a luma only.
cv::Vec4f SumsOf(const Photo& photo, const Weights& weights, const PlaneU8& mask, size_t i) {
  const cv::Vec3f ycc = YccOfRgb(LinearPixel(photo, i));
  const float y = std::max(ycc[0], 0.0f);
  if (!mask.empty() && mask.data[i] == 0) return {0, 0, 0, y};
  const float power = weights.power(static_cast<int>(i));
  const cv::Vec2f lost = weights.lost(static_cast<int>(i));
  return {power * ycc[1] + lost[0], power * ycc[2] + lost[1], power * ycc[0], y};
}

// The means of 2x2 squares, fewer at an odd edge. sums(x, y) of a picture of that size.
template <class SumsAt>
Sums Halved(int width, int height, const SumsAt& sums) {
  Sums half((height + 1) / 2, (width + 1) / 2);
  for (int y = 0; y < half.rows; ++y) {
    const int below = std::min(2 * y + 1, height - 1);
    for (int x = 0; x < half.cols; ++x) {
      const int right = std::min(2 * x + 1, width - 1);
      half(y, x) = 0.25f * (sums(2 * x, 2 * y) + sums(right, 2 * y) + sums(2 * x, below) +
                            sums(right, below));
    }
  }
  return half;
}

// Levels 1 and up. Level 0 is the photo itself.
std::vector<Sums> Pyramid(const Photo& photo, const Weights& weights, const PlaneU8& mask) {
  std::vector<Sums> levels;
  levels.push_back(Halved(photo.width, photo.height, [&](int x, int y) {
    return SumsOf(photo, weights, mask, size_t(y) * photo.width + x);
  }));
  while (levels.size() + 1 < kLevels && levels.back().total() > 1) {
    const Sums& fine = levels.back();
    levels.push_back(Halved(fine.cols, fine.rows, [&](int x, int y) { return fine(y, x); }));
  }
  return levels;
}

// What a table has between two of its levels; beyond `last`, what that has.
float AtLevel(const std::array<float, kLevels>& table, double level, int last) {
  const int low = std::min(static_cast<int>(level), last), high = std::min(low + 1, last);
  return static_cast<float>(table[low] + (level - low) * (table[high] - table[low]));
}

// Variance of Cb and Cr that a square of 2^level of the camera's pixels has, in square codes.
float NoiseVariance(double level, const ColorPrior& prior) {
  // A DC coefficient is eight times the mean of 8x8 samples, of 16x16 px.
  const double dc =
      std::pow(prior.steps.chroma / 8, 2) / 12 / std::exp2(2 * std::max(0.0, level - 4));
  // What is not alike averages out over a square, as the noise itself does.
  const double sensor = SensorVariance(prior), alike = AlikeRounding(prior);
  const double rounding = kRounding * prior.steps.code * prior.steps.code;
  const double independent = rounding * (1 - alike) + kNoiseOfChroma * sensor;
  return static_cast<float>(kCorrelation *
                            (rounding * AtLevel(kShares, level, kLevels - 1) * alike +
                             independent / std::exp2(2 * level) + dc));
}

// What is known of the squares of a level before they are looked at: how their colours deviate from
// their parents', and the noise of their own.
struct Level {
  Level(double level, const ColorPrior& prior)
      : flat(AtLevel(kFlat, level, kLevels - 2)),
        edge(AtLevel(kEdge, level, kLevels - 2)),
        noise(NoiseVariance(level, prior)) {}

  float flat, edge, noise;
};

// The posterior of a square from its parent's, whose variance of colour about it was added.
cv::Vec4f Update(const cv::Vec4f& prior, const cv::Vec4f& sums, float noise) {
  // Share of the observation: v / (v + noise / power), also where there is no power at all.
  const float power = std::max(sums[2], 0.0f);
  const float share = prior[2] * power / (prior[2] * power + noise);
  const float per_power = 1 / (power + kTiny);
  return {prior[0] + share * (sums[0] * per_power - prior[0]),
          prior[1] + share * (sums[1] * per_power - prior[1]), prior[2] * (1 - share), sums[3]};
}

// The same from its parents' estimates, interpolated.
cv::Vec4f Descend(cv::Vec4f parent, const cv::Vec4f& sums, const Level& level) {
  const float edge = std::abs(std::log((sums[3] + kTiny) / (parent[3] + kTiny)));
  const float deviation = level.flat + level.edge * std::min(edge, kMostEdge);
  parent[2] += deviation * deviation;
  return Update(parent, sums, level.noise);
}

// body(x, y, estimate) for every square of a level of that size, with its parents' estimates
// interpolated linearly.
template <class Body>
void ForInterpolated(const Estimates& parents, int width, int height, const Body& body) {
  std::vector<cv::Vec4f> row(parents.cols);
  for (int y = 0; y < height; ++y) {
    const cv::Vec4f* near = parents[y / 2];
    const cv::Vec4f* far = parents[std::clamp(y / 2 + (y % 2 != 0 ? 1 : -1), 0, parents.rows - 1)];
    for (int x = 0; x < parents.cols; ++x) row[x] = 0.75f * near[x] + 0.25f * far[x];
    for (int x = 0; x < width; ++x) {
      const int beside = std::clamp(x / 2 + (x % 2 != 0 ? 1 : -1), 0, parents.cols - 1);
      body(x, y, cv::Vec4f(0.75f * row[x / 2] + 0.25f * row[beside]));
    }
  }
}

// Colours of squares of 2 px, from the largest squares down. A pixel is 2^finest of the camera's
// wide.
Estimates InferRatios(const std::vector<Sums>& levels, double finest, const ColorPrior& prior) {
  int level = static_cast<int>(levels.size());  // of levels.back()
  const float root = std::pow(kFlat[kLevels - 1], 2);
  const cv::Vec4f capture(prior.cb, prior.cr, root, 0);
  Estimates estimates(levels.back().size());
  const float most_noise = NoiseVariance(finest + level, prior);
  for (int i = 0; i < estimates.rows * estimates.cols; ++i) {
    estimates(i) = Update(capture, levels.back()(i), most_noise);
  }
  while (--level >= 1) {
    const Sums& sums = levels[level - 1];
    const Level facts(finest + level, prior);
    Estimates finer(sums.size());
    ForInterpolated(estimates, sums.cols, sums.rows, [&](int x, int y, const cv::Vec4f& parent) {
      finer(y, x) = Descend(parent, sums(y, x), facts);
    });
    estimates = finer;
  }
  return estimates;
}

}  // namespace

ColorPrior MeasureColorPrior(const Photo& photo, const FileSteps& steps, const PlaneU8& mask) {
  ColorPrior prior;
  prior.steps = steps;
  if (photo.empty()) return prior;
  std::vector<float> luma(photo.pixels());
  for (size_t i = 0; i < luma.size(); ++i) luma[i] = YccOfRgb(EncodedPixel(photo, i))[0];
  prior.luma_noise =
      NoiseOfChannel(luma.data(), photo.width, photo.height, mask, kShadowTop / 255).Deviation();
  static const JpegChroma grey(cv::Vec2f(0, 0));
  const Weights weights = WeightsOf(photo, prior, grey);
  cv::Vec3d total(0, 0, 0);  // as in Sums
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    const int16_t* p = &photo.data[3 * i];
    if (std::max({p[0], p[1], p[2]}) >= kTintedSample) return;
    const cv::Vec4f sums = SumsOf(photo, weights, {}, i);
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
  std::vector<double> noises;  // of the photos that have dark pixels
  for (const ColorPrior& prior : priors) {
    if (prior.luma_noise > 0) noises.push_back(prior.luma_noise);
  }
  ColorPrior out = {.cb = median(&ColorPrior::cb),
                    .cr = median(&ColorPrior::cr),
                    .steps = {.code = 0},
                    .luma_noise = noises.empty() ? 0 : Median(std::move(noises))};
  for (const ColorPrior& prior : priors) {
    out.steps.code = std::max(out.steps.code, prior.steps.code);
    out.steps.chroma = std::max(out.steps.chroma, prior.steps.chroma);
  }
  return out;
}

ShadowColors::ShadowColors(const ColorPrior& prior)
    : prior_(prior),
      chroma_(std::make_shared<const JpegChroma>(
          cv::Vec2f(static_cast<float>(prior.cb), static_cast<float>(prior.cr)))) {}

Photo ShadowColors::Infer(const Photo& photo, const PlaneU8& mask, double shrunk) const {
  const double finest = std::log2(std::max(shrunk, 1.0));
  const Weights weights = WeightsOf(photo, prior_, *chroma_);
  const Estimates ratios = InferRatios(Pyramid(photo, weights, mask), finest, prior_);
  const Level facts(finest, prior_);
  const SampleTable& sample = SampleTable::Get();
  Photo out = photo;
  ForInterpolated(ratios, photo.width, photo.height, [&](int x, int y, const cv::Vec4f& parent) {
    const size_t i = size_t(y) * photo.width + x;
    const float code = 255 * YccOfRgb(EncodedPixel(photo, i))[0];
    if (code >= kShadowTop) return;
    const cv::Vec4f sums = SumsOf(photo, weights, mask, i);
    const cv::Vec4f ratio = Descend(parent, sums, facts);
    const float luma = YccOfRgb(LinearPixel(photo, i))[0];
    const cv::Vec3f inferred = RgbOfYcc({luma, sums[3] * ratio[0], sums[3] * ratio[1]});
    const float share = 1 - SmoothStep(2 * code / kShadowTop - 1);
    for (int c = 0; c < 3; ++c) {
      int16_t& value = out.data[3 * i + c];
      value += static_cast<int16_t>(std::lrint(share * (sample(inferred[c]) - value)));
    }
  });
  return out;
}

}  // namespace litags
