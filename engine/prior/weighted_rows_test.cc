#include "engine/prior/weighted_rows.h"

#include <gtest/gtest.h>

#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"

namespace litags {
namespace {

TEST(SumWeightedRows, HasTheBytesOfAPlainLoopOnEveryTarget) {
  ForEachTarget([] {
    const CounterRng rng(3, 1);
    for (const size_t n : {1, 7, 16, 61}) {
      for (const size_t taps : {1, 2, 9}) {
        std::vector<float> pixels(n + taps), weights(taps), want(n, 0.0f), got(n);
        for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<float>(rng.Normal(i));
        std::vector<const float*> rows;
        for (size_t k = 0; k < taps; ++k) {
          weights[k] = static_cast<float>(rng.Normal(1000 + k));
          rows.push_back(pixels.data() + k);  // they overlap
          for (size_t i = 0; i < n; ++i) {
            const float product = weights[k] * rows[k][i];
            want[i] += product;
          }
        }
        SumWeightedRows(rows, weights, n, got.data());
        EXPECT_EQ(got, want) << n << " " << taps;
      }
    }
  });
}

}  // namespace
}  // namespace litags
