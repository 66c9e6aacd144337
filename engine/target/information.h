// Which pixels of badly lit photos are worth believing.
#ifndef LITAGS_ENGINE_TARGET_INFORMATION_H_
#define LITAGS_ENGINE_TARGET_INFORMATION_H_

#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/target/response.h"

namespace litags {

inline constexpr int kClippedCode = 254;       // the first with no sample below kClippedSample
inline constexpr double kClippedNoise = 48;    // what a filled-in area may be wrong by. Choice
inline constexpr double kToleratedNoise = 12;  // halves a weight. Choice

// What InformationWeights() stores for a weight of 1, the mean of a capture.
inline constexpr int kInformationOne = 64;

// Weight of every pixel in the losses that compare with photos and targets, where photos of
// different exposure know different parts of the scene: the dark one a lamp, the bright one the
// shade. It is the mean over channels of (1 + (best / T)^2) / (1 + (noise / T)^2), at most 1, with
// the noise of the photo's code, the best that photos of another exposure have where the target is
// as bright, and T = kToleratedNoise; brought to a mean of 1 over what counts of the capture and
// stored in steps of 1 / kInformationOne, at most 255 of them. One plane per photo. `exposures` as
// for MakeTargets (tone.h); none, all pixels alike, where they are within kLikeExposures.
// `brightened`, one per photo or none, tells what its camera stored. `code_step`: see FileSteps
// (shadow_color.h). The same for any `threads`; once `cancel` is raised, there soon are none.
std::vector<PlaneU8> InformationWeights(absl::Span<const Photo* const> photos,
                                        absl::Span<const Photo* const> targets,
                                        absl::Span<const double> exposures,
                                        absl::Span<const PlaneU8> masks = {},
                                        absl::Span<const Brightening> brightened = {},
                                        double code_step = 1, int threads = 1,
                                        const CancelToken& cancel = CancelToken());

inline constexpr double kLikeExposures = 2;  // the largest over the smallest, a stop. Choice

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_INFORMATION_H_
