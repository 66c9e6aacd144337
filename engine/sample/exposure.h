// How long each photo of a capture is exposed, and the three photos of a view that follow.
#ifndef LITAGS_ENGINE_SAMPLE_EXPOSURE_H_
#define LITAGS_ENGINE_SAMPLE_EXPOSURE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/sample/capture.h"

namespace litags::sample {

struct Exposures {
  double low = 0, over = 0;  // gain against the normal picture, linear
  // Per view and channel: gain, jitter and white balance.
  std::vector<std::array<double, 3>> low_gain, over_gain;
};

// Scales `light` (views of linear radiance, [3, H, W]) so that 1 is white in a normal picture of
// mean level kHighMean, then solves for the two gains that give options.low_mean and kOverPsnr.
// `lamps`: what LampLight() says of each view, or none.
Exposures SolveExposures(const CaptureOptions& options, const std::vector<Planes>& lamps,
                         std::vector<Planes>* light);

// Light of a lamp at the camera, [1, H, W], for a view with these depths [1, H, W], metres: 1 on
// the optical axis 2 m away; it falls with the square of the distance, and by half 20 degrees off
// the axis.
Planes LampLight(const Camera& camera, const Planes& depth);
// The view lit by it, in place of the room's lights.
Planes Lit(const Planes& light, const Planes& lamp);

// The photos of one view whose light is scaled as above; `white`: what is white of light that is
// not.
ImageU8 NormalPhoto(const Planes& light, double white = 1);
ImageU8 LowPhoto(const CaptureOptions& options, const Exposures& exposures, const Planes& light,
                 size_t view);
// The sensor's numbers that LowPhoto stores in 8 bits.
std::vector<uint16_t> LowNumbers(const CaptureOptions& options, const Exposures& exposures,
                                 const Planes& light, size_t view);
ImageU8 OverPhoto(const CaptureOptions& options, const Exposures& exposures, const Planes& light,
                  size_t view);

// Mean of all codes, [0, 1].
double MeanLevel(const ImageU8& image);

// dB, peak 255, over all channels; 120 for equal pictures. Sizes are equal.
double PhotoPsnr(const ImageU8& a, const ImageU8& b);

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_EXPOSURE_H_
