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

// Deviation of the Gaussian for photos of this size, px: 1 px at 500 px of the longer side, which
// is the same for a photo and one taken upright; not below the 0.5 px that a sampled Gaussian
// needs. Choice
double PriorSigma(int width, int height);

// What StructurePrior needs of the shorter side of such a photo at PriorSigma, px.
int LeastPriorSide(int width, int height);

// LITA-GS Eq. 4 and Eq. 5 with beta = gamma = 1; in place of Eq. 7 2-D Gaussian derivatives of
// deviation `sigma_px` over the equally smoothed E (Geusebroek et al. 2001). Choice
// P of one photo [3, H, W] -> [1, H, W]; not normalised, not clipped; values as encoded, not
// linearised. The divisor is E, but `floor`, codes of [0, 1], at least. INVALID_ARGUMENT if the
// photo is smaller than the kernel's radius + 1.
absl::StatusOr<Planes> StructurePrior(const Planes& rgb, double sigma_px, double floor);

// Standard deviation of the noise of E in the darker half of one photo (engine/noise), codes of
// [0, 1]; never below the rounding noise of 8 bits seen by E.
double IntensityNoise(const Photo& photo, const PlaneU8& mask = {});

// Below this E, codes of [0, 1], a photo says nothing about structure: three times the median of
// IntensityNoise over the capture; at most 1. Choice
double IntensityFloor(absl::Span<const Photo> photos, int threads,
                      absl::Span<const PlaneU8> masks = {});

struct CapturePriors {
  // P / scale clipped to [0, 1], times 255, to a step; one per photo, in order
  std::vector<PlaneU8> maps;
  double scale = 0;  // P that maps to 1: the percentile, to 0.2%
  double floor = 0;  // IntensityFloor()
};

// P of every photo, with slopes by the photos' sides, not by pixels, so that the same picture has
// the same map at any size; divided by the 99th percentile (choice) of P > 0 over all of them so
// that L1 has one scale for the capture; `masks`: see MaskOf, only pixels that count decide the
// scale. Deterministic for any `threads` (<= 0: all cores). `done` is called with ParallelFor's
// thread for every photo. CANCELLED on request, INVALID_ARGUMENT for a capture with a photo that is
// too small or without any structure.
absl::StatusOr<CapturePriors> ComputeCapturePriors(absl::Span<const Photo> photos, int threads,
                                                   const CancelToken& cancel,
                                                   absl::Span<const PlaneU8> masks = {},
                                                   const std::function<void(int)>& done = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_PRIOR_STRUCTURE_PRIOR_H_
