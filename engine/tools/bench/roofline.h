// The least that a part of an iteration must spend, and the time that takes at the machine's peaks.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_ROOFLINE_H_
#define LITAGS_ENGINE_TOOLS_BENCH_ROOFLINE_H_

#include <algorithm>
#include <cstdint>

#include "engine/render/projection.h"

namespace litags {

struct Work {
  double flops = 0;  // a multiply-add is two
  double bytes = 0;  // to and from memory
};

struct Peaks {
  double gflops = 0, gbytes_per_second = 0;

  double LeastMilliseconds(const Work& work) const {
    return std::max(work.flops / gflops, work.bytes / gbytes_per_second) / 1e6;
  }
};

// Per evaluation of alpha: 10 for the exponent, 15 for 2^x and its limits, 3 for transmittance and
// weight, 2 per channel.
constexpr Work ForwardWork(int64_t evaluations, int channels) {
  return {.flops = double(evaluations) * (28 + 2 * channels)};
}

// Alpha and transmittance once more, a product per channel and 4 for the weights, 2 for each sum.
constexpr Work BackwardWork(int64_t evaluations, int channels) {
  return {.flops = double(evaluations) * (27 + 2 * channels + 4 + 2 * GradStride(channels))};
}

// SSIM of three channels twice (L_exp and L_rec): 4 + 3 separable blurs of 11 taps.
constexpr Work LossWork(double pixels) { return {.flops = pixels * 3 * 2 * (4 + 3) * 2 * 11 * 2}; }

// Three 3x3 convolutions 3 -> h -> h -> 3, forward, input and weight gradient; F(4,3) along y
// saves half of the multiplications.
constexpr Work DenoiserWork(double pixels, int hidden, int stages) {
  const double multiply_adds = 9.0 * hidden * (3 + hidden + 3);
  return {.flops = pixels * stages * 3 * multiply_adds * 2 / 2};
}

// Parameter and two moments, read and written.
constexpr Work AdamWork(double gaussians, int rows) {
  return {.bytes = gaussians * rows * sizeof(float) * 3 * 2};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_ROOFLINE_H_
