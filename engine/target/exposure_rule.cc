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

const ExposureRule& ExposureRule::Default() {
  static constexpr ExposureRule kRule = {
      {0.419, 0.212, 0.333, 0.890, 0.694, 1.520, 0.898, 1.412, -0.079, -0.488, 0.732, -0.474},
      -2.55,
      0.10};
  return kRule;
}

void LightHistogram::Add(double light, double weight) {
  const double stops = light > 0 ? std::log2(light) : kLowest;
  // Between two bins, so that the histogram is continuous in the light.
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
  const double step = 1.0 / kBinsPerStop;
  const double kept = std::exp(-step);  // of the share, from one bin to the next
  constexpr int kSteps = 8 * kBinsPerStop;
  const double first = weight * (1 - kept) / (1 - std::exp(-step * kSteps));
  for (int i = 0; i < kSteps; ++i) {
    Add(white * std::exp2((i + 0.5) * step), first * std::pow(kept, i));
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
  return std::exp2(MeanByScore(scores, first) + rule.offset);
}

}  // namespace litags
