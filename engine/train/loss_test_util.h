// Helpers of the loss tests.
#ifndef LITAGS_ENGINE_TRAIN_LOSS_TEST_UTIL_H_
#define LITAGS_ENGINE_TRAIN_LOSS_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/rng.h"

namespace litags {

// Uniform in (0.05, 0.95): no two samples are equal, so |x - y| has a derivative.
inline Planes RandomPlanes(int channels, int height, int width, uint64_t stream) {
  Planes planes(channels, height, width);
  const CounterRng rng(17, stream);
  for (size_t i = 0; i < planes.data.size(); ++i) {
    planes.data[i] = static_cast<float>(0.05 + 0.9 * rng.Uniform(i));
  }
  return planes;
}

// Per element within `tolerance` of the largest expected entry, and as a vector: relative L2 error
// and signed bias within the same.
inline void ExpectGradientsNear(const std::vector<float>& actual,
                                const std::vector<double>& expected, double tolerance,
                                const char* name) {
  ASSERT_EQ(actual.size(), expected.size()) << name;
  double largest = 0, error = 0, error2 = 0, norm2 = 0, bias = 0;
  for (size_t i = 0; i < actual.size(); ++i) {
    const double difference = actual[i] - expected[i];
    largest = std::max(largest, std::abs(expected[i]));
    // Not max(): a NaN must not pass.
    if (!(std::abs(difference) <= error)) error = std::abs(difference);
    error2 += difference * difference;
    norm2 += expected[i] * expected[i];
    bias += difference;
  }
  // Gradients that vanish altogether leave only rounding to compare.
  constexpr double kNothing = 1e-9;
  EXPECT_LE(error, tolerance * largest + kNothing) << name;
  EXPECT_LE(std::sqrt(error2), tolerance * std::sqrt(norm2) + kNothing) << name;
  EXPECT_LE(std::abs(bias) / actual.size(), tolerance * largest + kNothing) << name;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_LOSS_TEST_UTIL_H_
