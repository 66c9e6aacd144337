// Which pixels of badly lit photos are worth believing.
#ifndef LITAGS_ENGINE_TARGET_INFORMATION_H_
#define LITAGS_ENGINE_TARGET_INFORMATION_H_

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

inline constexpr int kClippedCode = 254;       // and above; JPEG moves white a little
inline constexpr double kClippedNoise = 48;    // what a filled-in area may be wrong by. Choice
inline constexpr double kToleratedNoise = 12;  // halves a weight. Choice

// What InformationWeights() stores for a weight of 1, the mean of a capture.
inline constexpr int kInformationOne = 64;

// Deviation of noise whose differences to the mean of the four neighbours have this lower quartile
// of magnitudes: they have sqrt(5/4) of it, and a normal distribution's quartile is 0.3186 of its
// deviation. Flat areas set that quartile, not edges.
inline double NoiseOfDifferences(double lower_quartile) {
  return lower_quartile / (0.3186 * std::sqrt(1.25));
}

// Counts of differences to the mean of the four neighbours, in sixteenths of an 8-bit code.
using NoiseDifferences = std::array<int64_t, 16 * 256>;

// Of the targets where their photos have each code; codes of 255.
struct CodeStatistics {
  std::array<double, 256> mean;
  // Standard deviation of the target's error, the larger of two: the noise measured in the targets,
  // from differences to the mean of the four neighbours (the lower quartile, which flat areas set,
  // not edges); and that of rounding the photo to its code, the target's step from code to code /
  // sqrt(12). Clipped highlights have kClippedNoise or more.
  std::array<double, 256> noise;
};

// Codes that hardly occur take over their neighbours'. `masks`: see MaskOf; pixels that do not
// count say nothing. Sizes must agree (LITAGS_CHECK).
CodeStatistics MeasureTargets(absl::Span<const Photo* const> photos,
                              absl::Span<const Photo* const> targets,
                              absl::Span<const PlaneU8> masks = {});

// Measures the noise of pictures, one figure for all that were added: as above from the lower
// quartile of differences, without those at code 0, which black cuts off. Fine texture all over the
// pictures counts as noise, too.
class PictureNoise {
 public:
  // `mask` as in engine/core/mask.h.
  void Add(const Photo& picture, const PlaneU8& mask);
  void Add(const PictureNoise& other);

  // Standard deviation, codes of 255; 0 if nothing was added.
  double Deviation() const;

 private:
  NoiseDifferences differences_ = {};
};

// Weight of every pixel in the losses that compare with photos and targets, where photos of
// different exposure know different parts of the scene: the dark one a lamp, the bright one the
// shade. It is the mean over channels of (1 + (best / T)^2) / (1 + (noise / T)^2), at most 1, with
// the noise of the photo's code, the best that photos of another exposure have where the target is
// as bright, and T = kToleratedNoise; brought to a mean of 1 over what counts of the capture and
// stored in steps of 1 / kInformationOne, at most 255 of them. One plane per photo. `exposures` as
// for MakeTargets (tone.h); none, all pixels alike, where they are within kLikeExposures.
std::vector<PlaneU8> InformationWeights(absl::Span<const Photo* const> photos,
                                        absl::Span<const Photo* const> targets,
                                        absl::Span<const double> exposures,
                                        absl::Span<const PlaneU8> masks = {});

inline constexpr double kLikeExposures = 2;  // the largest over the smallest, a stop. Choice

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_INFORMATION_H_
