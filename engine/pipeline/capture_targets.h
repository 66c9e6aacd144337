// The second stage: what pictures of the scene are compared with.
#ifndef LITAGS_ENGINE_PIPELINE_CAPTURE_TARGETS_H_
#define LITAGS_ENGINE_PIPELINE_CAPTURE_TARGETS_H_

#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/color.h"
#include "engine/core/noise_curve.h"
#include "engine/core/photo.h"
#include "engine/pipeline/posed_photos.h"
#include "engine/render/renderer.h"

namespace litags {

// Index = photo, as in PosedPhotos.
struct CaptureTargets {
  std::vector<Photo> photos;         // without what their camera did to the light (even_response.h)
  Lamp lamp;                         // that they were taken by, as it shows in the targets
  std::vector<double> exposures;     // light that they gathered relative to the median photo
  std::vector<Photo> targets;        // normally lit
  std::vector<PlaneU8> information;  // weights of pixels; none: the recipe has none
  std::vector<PlaneU8> structure;    // the prior's maps; none: the recipe has none
  NoiseCurve rounding;               // noise that rounding the photos leaves in the targets
  double noise_at_black = 0;         // of the targets, see NoiseAtBlack()
};

// `photos` are those of `posed`, which no later stage reads.
absl::StatusOr<CaptureTargets> MakeCaptureTargets(const Context& context, const PosedPhotos& posed,
                                                  std::vector<Photo> photos);

// The photos of one capture brightened by options.tone, as training compares with them but for what
// it infers of the colour of deep shadows, and for small differences of exposure, which need
// cameras: the baseline that every method has to beat. INVALID_ARGUMENT for an empty or all-black
// photo.
absl::StatusOr<std::vector<ImageU8>> MakePseudoTargets(const std::vector<Photo>& photos,
                                                       const ReconstructOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CAPTURE_TARGETS_H_
