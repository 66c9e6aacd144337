// The normal-light pseudo-target of badly lit photos (LITA-GS L_exp).
#ifndef LITAGS_ENGINE_TARGET_TONE_H_
#define LITAGS_ENGINE_TARGET_TONE_H_

#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/code_curve.h"
#include "engine/core/color.h"
#include "engine/core/noise_curve.h"
#include "engine/core/photo.h"
#include "engine/target/capture_light.h"
#include "engine/target/tone_options.h"

namespace litags {

struct ToneTarget {
  Photo image;          // the target
  double gain = 1;      // on codes (kPaper) or in linear light
  bool reached = true;  // false if max_gain was not enough
};

// Whether no target can be made of a photo, since no pixel that counts has any light.
bool IsBlack(const Photo& photo, const PlaneU8& mask, Tone rule);

// One target per photo, in order. `exposures`: light gathered by each photo relative to the
// others, > 0 (RelativeExposures() in photometric.h); kCapture evens them out, the other rules
// do not read them. All of a photo is mapped, also what its mask leaves out; each mask leaves a
// pixel or more. INVALID_ARGUMENT for bad options, an empty photo, or one that IsBlack (no gain
// helps; leave it out); CANCELLED, before the next target is begun. Deterministic for any
// `threads` (<= 0: all cores). `done` is called with ParallelFor's thread as each target is made.
absl::StatusOr<std::vector<ToneTarget>> MakeTargets(absl::Span<const Photo> photos,
                                                    absl::Span<const double> exposures,
                                                    const ToneOptions& options, int threads,
                                                    const CaptureFacts& facts = {},
                                                    const std::function<void(int)>& done = nullptr,
                                                    const CancelToken& cancel = CancelToken());

// The photo with `gain` times its linear light, clipped at white.
Photo WithLinearGain(const Photo& photo, double gain);

// What rounding a photo to its file's codes does to its target: the target's step from one of these
// codes to the next / sqrt(12), for the gain of a ToneTarget. In the dark it is many codes, and
// other photos of the place have the same, since they were rounded alike. `code_step`: see
// FileSteps (shadow_color.h).
NoiseCurve RoundingNoise(const ToneOptions& options, double gain, double code_step = 1);

// What a change of linear light (1: white), which may not fall, does to codes of kCapture's
// targets.
CodeCurve ChangeOfTargets(const ToneOptions& options,
                          const std::function<double(double light)>& change);

// The gain in linear light, for a photo of exposure 1, that gives the capture the exposure of a
// well exposed photo (exposure_rule.h); with lamps, the capture as it would be without them.
double CaptureGain(absl::Span<const Photo> photos, absl::Span<const double> exposures, int threads,
                   const CaptureFacts& facts = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_TONE_H_
