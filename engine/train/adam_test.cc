#include "engine/train/adam.h"

#include <cmath>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/train/train_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr size_t kBlockFloats = Splats::kBlockFloats;

// Adam of the paper (Algorithm 1) in double, one number at a time.
struct Oracle {
  explicit Oracle(double start) : value(start) {}
  void Update(int step, double lr, double gradient) {
    constexpr double kBeta1 = 0.9f, kBeta2 = 0.999f;  // the nearest floats, as the code has them
    m = kBeta1 * m + (1 - kBeta1) * gradient;
    v = kBeta2 * v + (1 - kBeta2) * gradient * gradient;
    const double m_hat = m / (1 - std::pow(kBeta1, step)), v_hat = v / (1 - std::pow(kBeta2, step));
    value -= lr * m_hat / (std::sqrt(v_hat) + 1e-15);
  }
  double value, m = 0, v = 0;
};

float Gradient(int step, size_t i) {
  const CounterRng rng(5, step);
  // Twelve decades: gradients of means and of opacities differ that much.
  return static_cast<float>(rng.Normal(2 * i) * std::pow(10.0, -12 * rng.Uniform(2 * i + 9)));
}

TEST(Adam, AgreesWithScalarDoublesAndLeavesInvisibleLanesAlone) {
  constexpr int kSteps = 30, kRows = SplatRowsForDegree(1);
  ForEachTarget([&] {
    Splats params(2 * kSplatBlock), m1(2 * kSplatBlock), m2(2 * kSplatBlock);
    std::vector<Oracle> want;
    for (size_t i = 0; i < kBlockFloats; ++i) {
      params.block(1)[i] = static_cast<float>(CounterRng(6, 1).Normal(i));
      want.emplace_back(params.block(1)[i]);
    }
    AlignedFloats grads(kBlockFloats);
    for (int step = 1; step <= kSteps; ++step) {
      AdamStep adam(step, AdamConstants());
      adam.rows = kRows;
      for (int row = 0; row < kSplatRows; ++row) adam.lr[row] = 1e-4f * (row + 1);
      const auto visible = static_cast<uint32_t>(CounterRng(7, 0).Bits(step) & 0xFFFF);
      for (size_t i = 0; i < kBlockFloats; ++i) grads[i] = Gradient(step, i);
      const AlignedFloats before = params.data();
      AdamUpdateBlock(adam, grads.data(), visible, 1, &params, &m1, &m2);
      for (size_t i = 0; i < kBlockFloats; ++i) {
        const size_t row = i / kSplatBlock, lane = i % kSplatBlock;
        if (row < kRows && (visible >> lane & 1) != 0) {
          want[i].Update(step, adam.lr[row], grads[i]);
        } else {
          ASSERT_EQ(params.block(1)[i], before[kBlockFloats + i]) << "row " << row;
        }
      }
    }
    for (size_t i = 0; i < kBlockFloats; ++i) {
      // 30 float additions of steps up to 1e-4 (row + 1), onto values near 1.
      ASSERT_NEAR(params.block(1)[i], want[i].value, 4e-6) << i;
      ASSERT_NEAR(m1.block(1)[i], want[i].m, 1e-5 * std::abs(want[i].m) + 1e-8) << i;
      ASSERT_NEAR(m2.block(1)[i], want[i].v, 1e-5 * want[i].v + 1e-12) << i;
      ASSERT_EQ(params.block(0)[i], 0.0f) << "another block was touched";
    }
  });
}

TEST(Adam, NothingVisibleChangesNothing) {
  ForEachTarget([] {
    Splats params = ColoredCloud(16, 1), m1(16), m2(16);
    const AlignedFloats before = params.data();
    AlignedFloats grads(kBlockFloats, 1.0f);
    AdamStep step(1, AdamConstants());
    step.lr.fill(1);
    AdamUpdateBlock(step, grads.data(), 0, 0, &params, &m1, &m2);
    EXPECT_TRUE(SameBytes(params.data(), before));
    EXPECT_TRUE(SameBytes(m1.data(), Splats(16).data()));
  });
}

TEST(Adam, FlatArraysAgreeWithScalarDoubles) {
  constexpr size_t kCount = 37;
  std::vector<float> params(kCount, 0.5f), m1(kCount), m2(kCount), grads(kCount);
  std::vector<Oracle> want(kCount, Oracle(0.5));
  for (int step = 1; step <= 30; ++step) {
    for (size_t i = 0; i < kCount; ++i) {
      grads[i] = Gradient(step, i);
      want[i].Update(step, 1e-2, grads[i]);
    }
    AdamUpdate(AdamStep(step, AdamConstants()), 1e-2f, grads, absl::MakeSpan(params),
               absl::MakeSpan(m1), absl::MakeSpan(m2));
  }
  for (size_t i = 0; i < kCount; ++i) EXPECT_NEAR(params[i], want[i].value, 4e-6) << i;
}

TEST(Adam, FirstStepMovesByTheLearningRateWhateverTheGradientsSize) {
  for (const float gradient : {1e-9f, 1.0f, 1e9f}) {
    std::vector<float> param = {0.0f}, m1 = {0.0f}, m2 = {0.0f};
    const std::vector<float> grads = {gradient};
    AdamUpdate(AdamStep(1, AdamConstants()), 0.25f, grads, absl::MakeSpan(param),
               absl::MakeSpan(m1), absl::MakeSpan(m2));
    EXPECT_NEAR(param[0], -0.25f, 2e-6) << gradient;
  }
}

}  // namespace
}  // namespace litags
