// The light of a capture, as the exposure rule counts it.
#ifndef LITAGS_ENGINE_TARGET_CAPTURE_LIGHT_H_
#define LITAGS_ENGINE_TARGET_CAPTURE_LIGHT_H_

#include <optional>

#include "absl/types/span.h"
#include "engine/core/photo.h"
#include "engine/target/exposure_rule.h"
#include "engine/target/lamp_light.h"
#include "engine/target/response.h"

namespace litags {

// What is known of a capture beside its photos; spans have one of each photo, or none.
struct CaptureFacts {
  absl::Span<const PlaneU8> masks = {};           // see MaskOf: only pixels that count decide gains
  absl::Span<const Brightening> brightened = {};  // what was done to the photos: what is clipped
  absl::Span<const LampLight> lamps = {};         // evened out
  // Of the photos as their cameras wrote them (NoiseLevels::Floor); none: as they are now.
  std::optional<double> noise_floor = {};
};

// Means of small squares of all photos, after `exposures` and lamps were evened out. Of what no
// light fell on, what noise makes of it (noise_floor.h) counts for a tenth of what is lit at most,
// and black for a tenth of the two: both together for 0.21. Where nothing is lit, all noise counts.
// Deterministic for any `threads` (<= 0: all cores).
LightHistogram CaptureLight(absl::Span<const Photo> photos, absl::Span<const double> exposures,
                            int threads, const CaptureFacts& facts = {});

// A photo without any light: no sample is above this.
inline constexpr int16_t kBlackSample = 0.25f * kPhotoCode;

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_CAPTURE_LIGHT_H_
