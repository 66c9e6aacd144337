// Noise that a picture has where a noise-free one of the same view is flat.
#ifndef LITAGS_ENGINE_EVAL_NOISE_H_
#define LITAGS_ENGINE_EVAL_NOISE_H_

#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

struct FlatNoiseOptions {
  double share = 0.25;      // of the pixels: those with the least gradient are flat, (0, 1]
  int gradient_radius = 2;  // px; the gradient is averaged over a square, so that flat is a region
  // px; the residual's mean over a square of this radius is no noise but tone: a wall rendered too
  // dark, a curve of another shape. Blotches up to about this size count as noise, as they should:
  // they are what smoothing leaves of it.
  int mean_radius = 10;
};

// 1 where `clean` [3, H, W] is flat, [H, W].
std::vector<char> FlatPixels(const Planes& clean, const FlatNoiseOptions& options);

// Root mean square over `flat` pixels and channels of the residual picture - clean after its local
// mean over flat pixels was subtracted; codes in [0, 1]. INVALID_ARGUMENT (SIZE_MISMATCH).
absl::StatusOr<double> FlatNoise(const Planes& picture, const Planes& clean,
                                 const std::vector<char>& flat, const FlatNoiseOptions& options);

// The part of one of two pictures of a view in what they differ by, for pictures that differ by
// their noise alone: FlatNoise() of one against the other, over sqrt(2). Detail that both lack, or
// both made up, is no part of it. INVALID_ARGUMENT (SIZE_MISMATCH).
absl::StatusOr<double> NoiseBetween(const Planes& one, const Planes& other,
                                    const std::vector<char>& flat, const FlatNoiseOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_EVAL_NOISE_H_
