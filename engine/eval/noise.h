// Noise that a picture has where a noise-free one of the same view is flat.
#ifndef LITAGS_ENGINE_EVAL_NOISE_H_
#define LITAGS_ENGINE_EVAL_NOISE_H_

#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

// Share of the pixels that are flat, those with the least gradient. Choice
inline constexpr double kFlatShare = 0.25;

// 1 where `clean` [3, H, W] is flat, [H, W]. `share` is in (0, 1].
std::vector<char> FlatPixels(const Planes& clean, double share = kFlatShare);

// Root mean square over `flat` pixels and channels of the residual picture - clean after its local
// mean over flat pixels was subtracted; codes in [0, 1]. INVALID_ARGUMENT (SIZE_MISMATCH).
absl::StatusOr<double> FlatNoise(const Planes& picture, const Planes& clean,
                                 const std::vector<char>& flat);

// The part of one of two pictures of a view in what they differ by, for pictures that differ by
// their noise alone: FlatNoise() of one against the other, over sqrt(2). Detail that both lack, or
// both made up, is no part of it. INVALID_ARGUMENT (SIZE_MISMATCH).
absl::StatusOr<double> NoiseBetween(const Planes& one, const Planes& other,
                                    const std::vector<char>& flat);

}  // namespace litags

#endif  // LITAGS_ENGINE_EVAL_NOISE_H_
