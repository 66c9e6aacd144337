// Adam (Kingma and Ba 2015) over blocks of Gaussians and over flat arrays.
#ifndef LITAGS_ENGINE_TRAIN_ADAM_H_
#define LITAGS_ENGINE_TRAIN_ADAM_H_

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/types/span.h"
#include "engine/core/splats.h"

namespace litags {

struct AdamConstants {
  float beta1 = 0.9f;
  float beta2 = 0.999f;
  float epsilon = 1e-15f;  // 3DGS
};

// Learning rate per row of Splats, and the step's bias correction.
struct AdamStep {
  AdamStep(int step, const AdamConstants& constants);  // step counts from 1

  AdamConstants constants;
  float inv_bias1;  // 1 / (1 - beta1^step)
  float inv_bias2;
  std::array<float, kSplatRows> lr = {};
  int rows = kSplatRows;  // rows [0, rows) are updated
};

// A rate's value at `progress`, 0..1: log-linear from `first` to `last`, either of which may be 0.
inline double FallingRate(double first, double last, double progress) {
  return first > 0 ? first * std::pow(last / first, progress) : 0;
}

// Updates block `block`: only lanes with their bit in `visible`; the others keep value and moments
// (as gsplat's selective Adam; most Gaussians are out of view most of the time). Thread-safe for
// different blocks. Returns the updated lanes of which a value or moment is no longer finite; to
// find them costs two multiplications by 0 a number.
uint32_t AdamUpdateBlock(const AdamStep& step, const float* grads, uint32_t visible, size_t block,
                         Splats* params, Splats* moment1, Splats* moment2);

// The same for flat arrays, all elements. False if one of them is no longer finite.
bool AdamUpdate(const AdamStep& step, float lr, absl::Span<const float> grads,
                absl::Span<float> params, absl::Span<float> moment1, absl::Span<float> moment2);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_ADAM_H_
