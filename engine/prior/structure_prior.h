// The illumination-invariant structure prior P of a photo (LITA-GS Sec. "Illumination-Invariant
// Prior Extraction"): gradients of the Gaussian colour model, divided by intensity.
#ifndef LITAGS_ENGINE_PRIOR_STRUCTURE_PRIOR_H_
#define LITAGS_ENGINE_PRIOR_STRUCTURE_PRIOR_H_

#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

enum class PriorBorder { kReflect101, kReplicate, kZero };

enum class PriorDerivative {
  // Choice: 2-D Gaussian derivatives over the equally smoothed E (Geusebroek et al. 2001).
  kSeparable2d,
  // The paper's sum to the letter: along its own axis only, over unsmoothed E.
  kOneAxis,
};

struct StructurePriorOptions {
  double sigma_px = 1.0;  // of the Gaussian, > 0; of an image of 500 px on its longer side. Choice
  // sigma_px times the longer side / 500, which is the same for a photo and one taken upright; not
  // below the 0.5 px that a sampled Gaussian needs. False: as it is.
  bool scale_sigma_to_size = true;
  double beta = 1.0;   // weight of the E_l term, >= 0; paper
  double gamma = 1.0;  // weight of the E_ll term, >= 0; paper
  PriorDerivative derivative = PriorDerivative::kSeparable2d;
  PriorBorder border = PriorBorder::kReflect101;
  bool l1_normalize = false;  // derivative kernels over their absolute sum (CIConv)

  // Divisor: max(E + epsilon, floor), in codes of [0, 1]. floor < 0: tied to the noise of the
  // capture, see NoiseFloor(). Choice
  double epsilon = 0.0;
  double floor = -1.0;
  double floor_noise_factor = 3.0;  // floor = factor * noise; > 0. Choice

  double percentile = 99.0;  // of P > 0 over the capture that maps to 1; (0, 100]. Choice

  absl::Status Validate() const;
};

// LITA-GS Eq. 4 and Eq. 5; by default with 2-D derivatives in place of Eq. 7.
// P of one photo [3, H, W] -> [1, H, W]; not normalised, not clipped. options.floor must be set
// (>= 0); values as encoded, not linearised. INVALID_ARGUMENT if the photo is smaller than the
// kernel's radius + 1.
absl::StatusOr<Planes> StructurePrior(const Planes& rgb, const StructurePriorOptions& options);

// Standard deviation of the noise of E in the darker half of one photo (engine/noise), codes of
// [0, 1]; never below the rounding noise of 8 bits seen by E.
double IntensityNoise(const Photo& photo, const PlaneU8& mask = {});

// Below this E a photo says nothing about structure: floor_noise_factor times the median of
// IntensityNoise over the capture; at most 1.
double NoiseFloor(absl::Span<const Photo> photos, const StructurePriorOptions& options, int threads,
                  absl::Span<const PlaneU8> masks = {});

struct CapturePriors {
  // P / scale clipped to [0, 1], times 255, to a step; one per photo, in order
  std::vector<PlaneU8> maps;
  double scale = 0;  // P that maps to 1: the percentile, to 0.2%
  double floor = 0;  // floor used
};

// P of every photo, divided by the percentile of P > 0 over all of them so that L1 has one scale
// for the capture; `masks`: see MaskOf, only pixels that count decide the scale. Deterministic for
// any `threads` (<= 0: all cores). `done` is called with ParallelFor's thread for every photo.
// CANCELLED on request, INVALID_ARGUMENT for a bad option or a capture without any structure.
absl::StatusOr<CapturePriors> ComputeCapturePriors(absl::Span<const Photo> photos,
                                                   const StructurePriorOptions& options,
                                                   int threads, const CancelToken& cancel,
                                                   absl::Span<const PlaneU8> masks = {},
                                                   const std::function<void(int)>& done = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_PRIOR_STRUCTURE_PRIOR_H_
