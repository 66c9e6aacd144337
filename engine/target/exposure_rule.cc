#include "engine/target/exposure_rule.h"

#include <cmath>

namespace litags {
namespace {

constexpr int kPerStop = LightHistogram::kBinsPerStop;

// Of ln(share + kLeastShare): a band that is nearly empty tells no more than an empty one. Choice
// between 0.003 and 0.05, which have the same cross-validated error within 0.02 stops.
constexpr double kLeastShare = 0.01;
constexpr double kBorder = 0.25;  // stops, softness of the borders between bands. Choice
constexpr double kSpread = 4;     // stops, see ExposureGain. Choice: wide, it decides nothing
                                  // where the bands tell anything

// The share of light above a level, for levels that are multiples of a bin's width.
class ShareAbove {
 public:
  explicit ShareAbove(const LightHistogram& light) {
    for (int i = 0; i < kLevels; ++i) {
      const double level = LightHistogram::kLowest - kMargin + double(i) / kPerStop;
      double sum = 0;
      for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
        const double weight = light.weight(bin);
        if (weight > 0) sum += weight * Above(LightHistogram::Stops(bin) - level);
      }
      shares_[i] = sum / light.total();
    }
  }

  // `level` counts bins' widths from 0 stops.
  double operator()(int level) const {
    return shares_[std::clamp(level - (LightHistogram::kLowest - kMargin) * kPerStop, 0,
                              kLevels - 1)];
  }

 private:
  static constexpr int kMargin = 4;  // stops, past which all is above or nothing
  static constexpr int kLevels = LightHistogram::kBins + 2 * kMargin * kPerStop + 1;

  static double Above(double stops) { return 1 / (1 + std::exp(-stops / kBorder)); }

  std::array<double, kLevels> shares_;
};

// Of the steps `first` and on, in stops.
double MeanByScore(const std::vector<double>& scores, int first) {
  const double best = *std::max_element(scores.begin(), scores.end());
  double sum = 0, weights = 0;
  for (size_t i = 0; i < scores.size(); ++i) {
    const double weight = std::exp(scores[i] - best);
    sum += weight * (first + static_cast<int>(i));
    weights += weight;
  }
  return sum / weights / kPerStop;
}

}  // namespace

// litags-bench exposure photos_normal --fit; see docs/experiments/exposure.md.
const ExposureRule& ExposureRule::Default() {
  static constexpr ExposureRule kRule = {
      {0.417, 0.178, 0.358, 0.911, 0.704, 1.519, 0.949, 1.373, -0.025, -0.471, 0.601, -0.460},
      -2.55};
  return kRule;
}

void LightHistogram::Add(double light, double weight) {
  AddAt(light > 0 ? std::log2(light) : kLowest, weight);
}

// Between two bins, so that the histogram is continuous in the light.
void LightHistogram::AddAt(double stops, double weight) {
  const double place = std::clamp((stops - kLowest) * kBinsPerStop - 0.5, 0.0, kBins - 1.0);
  const int bin = std::min(static_cast<int>(place), kBins - 2);
  weights_[bin] += weight * (bin + 1 - place);
  weights_[bin + 1] += weight * (place - bin);
  total_ += weight;
}

void LightHistogram::Add(const LightHistogram& other) {
  for (int bin = 0; bin < kBins; ++bin) weights_[bin] += other.weights_[bin];
  total_ += other.total_;
}

void LightHistogram::AddClipped(double white, double weight) {
  constexpr double kStep = 1.0 / kBinsPerStop;
  constexpr int kSteps = 8 * kBinsPerStop;       // past which 0.03 % of it would lie
  static const double kKept = std::exp(-kStep);  // of the share, from one bin to the next
  const double first = std::log2(white) + kStep / 2;
  double share = weight * (1 - kKept) / (1 - std::exp(-kStep * kSteps));
  for (int i = 0; i < kSteps; ++i, share *= kKept) AddAt(first + i * kStep, share);
}

void LightHistogram::AddPixel(double red, double green, double blue, double exposure,
                              double weight) {
  constexpr double kClipped = 0.97;  // JPEG and averaging leave clipped light a little below white
  const double light = LightOfPixel(red, green, blue);
  if (light < kClipped) {
    Add(light / exposure, weight);
  } else {
    AddClipped(1 / exposure, weight);
  }
}

std::vector<BandShares> LogBandShares(const LightHistogram& light, int first, int last) {
  const ShareAbove above(light);
  std::vector<BandShares> rows;
  rows.reserve(last - first + 1);
  for (int step = first; step <= last; ++step) {
    BandShares& row = rows.emplace_back();
    double rest = 1;
    for (int band = 0; band < ExposureRule::kBands; ++band) {
      const int edge = (ExposureRule::kLowestEdge + band) * kPerStop - step;
      const double higher = band + 1 < ExposureRule::kBands ? above(edge) : 0;
      row[band] = std::log(std::max(rest - higher, 0.0) + kLeastShare);
      rest = higher;
    }
  }
  return rows;
}

double Lightness(const LightHistogram& light) {
  if (!(light.total() > 0)) return 0;
  double sum = 0;
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    sum += light.weight(bin) * std::exp2(LightHistogram::Stops(bin) / 3);
  }
  return 3 * std::log2(sum / light.total());
}

double LightnessScore(double lightness, double population) {
  const double x = (lightness - population) / kSpread;
  return -0.5 * x * x;
}

double ExposureGain(const LightHistogram& light, const ExposureRule& rule) {
  if (!(light.total() > 0)) return 1;
  // Brings the lightness to within 16 stops of the population's: four times kSpread.
  const double lightness = Lightness(light);
  const int middle = static_cast<int>(std::lround((rule.lightness - lightness) * kPerStop));
  const int first = middle - 16 * kPerStop;
  const std::vector<BandShares> rows = LogBandShares(light, first, middle + 16 * kPerStop);
  std::vector<double> scores;
  for (const BandShares& row : rows) {
    const double stops = (first + double(scores.size())) / kPerStop;
    double score = LightnessScore(lightness + stops, rule.lightness);
    for (int band = 0; band < ExposureRule::kBands; ++band) score += rule.weights[band] * row[band];
    scores.push_back(score);
  }
  return std::exp2(MeanByScore(scores, first));
}

}  // namespace litags
