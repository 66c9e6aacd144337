// Chooses the exposure of a capture from what well exposed photos are like.
#ifndef LITAGS_ENGINE_TARGET_EXPOSURE_RULE_H_
#define LITAGS_ENGINE_TARGET_EXPOSURE_RULE_H_

#include <algorithm>
#include <array>
#include <vector>

#include "engine/core/color.h"

namespace litags {

// The light to add of a pixel, linear: half luma, which is how bright it looks, and half its
// largest channel, which clips first. Cross-validated error of the rule: 0.71 stops by luma, 0.65
// by this; the largest channel alone (0.64) is noise where JPEG lost the colour.
inline double LightOfPixel(double red, double green, double blue) {
  const double luma = Luma(red, green, blue);
  return 0.5 * (luma + std::max({red, green, blue}));
}

// How a capture's light is distributed: weights by log2 of linear light (1: a photo's white at
// exposure 1). All photos are pooled, after their exposures were evened out.
class LightHistogram {
 public:
  static constexpr int kBinsPerStop = 8;
  static constexpr int kLowest = -24, kHighest = 16;  // stops
  static constexpr int kBins = (kHighest - kLowest) * kBinsPerStop;

  // Light that was measured, divided by the photo's exposure. `weight` > 0. Light of 0 and less,
  // which noise around black has, counts as the darkest. Add means of 4x4 pixels or more in
  // linear light: single pixels of dark photos are mostly noise.
  void Add(double light, double weight);

  // Light that clipped at `white` (1 / the photo's exposure). It is spread upward from there as
  // light above white is in general: the share falls to 1 / e per stop. Choice.
  void AddClipped(double white, double weight);

  void Add(const LightHistogram& other);
  // A pixel or the mean of some: linear light of a photo as it was taken (1: its white), divided
  // by `exposure`. From 0.97 on it is taken for clipped.
  void AddPixel(double red, double green, double blue, double exposure, double weight);

  double total() const { return total_; }
  double weight(int bin) const { return weights_[bin]; }

  // The middle of a bin, in stops.
  static double Stops(int bin) { return kLowest + (bin + 0.5) / kBinsPerStop; }

 private:
  void AddAt(double stops, double weight);

  std::array<double, kBins> weights_ = {};
  double total_ = 0;
};

// The constants of the rule, from a population of well exposed photos.
struct ExposureRule {
  // A picture's light is cut into bands: below -7 stops, one stop each up to +3, and above.
  static constexpr int kLowestEdge = -7, kHighestEdge = 3;  // stops, 0: white
  static constexpr int kBands = kHighestEdge - kLowestEdge + 2;

  std::array<double, kBands> weights;  // how much a band's share counts, dark to bright
  double lightness;                    // mean over photos of Lightness(), stops

  // Fitted; see docs/experiments/exposure.md.
  static const ExposureRule& Default();
};

// ln(share + 0.01) of each band when the light is multiplied by 2^(step / kBinsPerStop), for
// `first` and the steps after it up to `last`. Borders between bands are soft (logistic, 1/4 stop),
// so that shares are continuous in the light. The histogram is not empty.
using BandShares = std::array<double, ExposureRule::kBands>;
std::vector<BandShares> LogBandShares(const LightHistogram& light, int first, int last);

// The mean lightness (cube root of light) as light again, log2. Of an empty histogram 0.
double Lightness(const LightHistogram& light);

// What a picture's lightness adds to its score: -((lightness - population) / 4 stops)^2 / 2. Keeps
// the answer defined for light that looks like no photo.
double LightnessScore(double lightness, double population);

// The gain in linear light for the capture. The score of a gain is
//   sum over bands of weight * ln(share + 0.01)  +  LightnessScore():
// highest where light is spread over the bands as it is in well exposed photos. The answer is the
// mean of the gains in stops, weighted by exp(score): it is continuous in the histogram. Lamps and
// windows above +3 stops are one band, no matter how far above. 1 without light. Never 0, infinite
// or NaN.
double ExposureGain(const LightHistogram& light,
                    const ExposureRule& rule = ExposureRule::Default());

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_EXPOSURE_RULE_H_
