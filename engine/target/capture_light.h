// The light of a capture, as the exposure rule counts it.
#ifndef LITAGS_ENGINE_TARGET_CAPTURE_LIGHT_H_
#define LITAGS_ENGINE_TARGET_CAPTURE_LIGHT_H_

#include "absl/types/span.h"
#include "engine/core/photo.h"
#include "engine/target/exposure_rule.h"
#include "engine/target/lamp_light.h"
#include "engine/target/response.h"

namespace litags {

// Means of small squares of all photos, after `exposures` and, if there are any, `lamps` (one per
// photo) were evened out. What no light fell on, and what noise makes of it (noise_floor.h), counts
// for a tenth of what is lit at most. `brightened`, if any, one per photo, tells what its camera
// clipped. `masks`: see MaskOf. Deterministic for any `threads` (<= 0:
// all cores).
LightHistogram CaptureLight(absl::Span<const Photo> photos, absl::Span<const double> exposures,
                            int threads, absl::Span<const PlaneU8> masks = {},
                            absl::Span<const LampLight> lamps = {},
                            absl::Span<const Brightening> brightened = {});

// A photo without any light: no sample is above this.
inline constexpr int16_t kBlackSample = 0.25f * kPhotoCode;

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_CAPTURE_LIGHT_H_
