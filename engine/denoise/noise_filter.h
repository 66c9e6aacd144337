// Smooths what a picture shows below its noise.
#ifndef LITAGS_ENGINE_DENOISE_NOISE_FILTER_H_
#define LITAGS_ENGINE_DENOISE_NOISE_FILTER_H_

#include "engine/core/aligned.h"
#include "engine/core/image.h"
#include "engine/core/noise_curve.h"

namespace litags {

// A local Wiener filter (J.-S. Lee, "Digital image enhancement and noise filtering by use of local
// statistics", 1980) of 5x5 pixels. A window whose luma varies by v, of which n^2 is noise, says
// that its pixels x are a x + (1 - a) mean with a = max(0, v - n^2) / v; n is the curve's at the
// window's mean. A pixel gets the mean of what the 25 windows around it say, as in the guided
// filter (He, Sun, Tang, 2010). All three channels share a, so no colours are made up. Beyond the
// border the picture is continued by its edge. Keeps its buffers between calls; results are the
// same bytes for any number of threads. Not thread-safe.
class NoiseFilter {
 public:
  // threads <= 0: all cores.
  explicit NoiseFilter(int threads) : threads_(threads) {}

  // Filters `color` [3, H, W] in place.
  void Apply(const NoiseCurve& noise, PlanesSpan color);

 private:
  int threads_;
  AlignedFloats maps_;     // a and (1 - a) mean of every pixel's window: [4, H, W]
  AlignedFloats scratch_;  // per thread
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_NOISE_FILTER_H_
