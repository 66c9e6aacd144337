#include "engine/denoise/pdm.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/denoise/padded_rows.h"
#include "engine/denoise/pdm_oracle.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

Planes RandomPlanes(int height, int width, double low, double high, uint64_t stream) {
  Planes planes(3, height, width);
  const CounterRng rng(7, stream);
  for (size_t i = 0; i < planes.data.size(); ++i) {
    planes.data[i] = static_cast<float>(low + (high - low) * rng.Uniform(i));
  }
  return planes;
}

// Every weight and bias away from zero, F of gain about one.
PdmWeights RandomWeights(const PdmOptions& options) {
  PdmWeights weights = PdmWeights::Initial(options, 3);
  for (size_t k = 0; k < weights.nets.size(); ++k) {
    const CounterRng rng(11, k);
    const double scale = 1.0 / std::sqrt(9.0 * options.hidden);
    for (size_t i = 0; i < weights.nets[k].size(); ++i) {
      weights.nets[k][i] += static_cast<float>(scale * rng.Normal(i));
    }
  }
  return weights;
}

OraclePdm MakeOracle(const PdmOptions& options, const PdmWeights& weights, const Planes& R0,
                     const Planes& N) {
  OraclePdm oracle{options, R0.height, R0.width, {}, {}, {}};
  for (const auto& net : weights.nets) oracle.nets.emplace_back(net.begin(), net.end());
  oracle.R0.assign(R0.data.begin(), R0.data.end());
  oracle.N.assign(N.data.begin(), N.data.end());
  return oracle;
}

double LargestError(const std::vector<float>& actual, const std::vector<double>& expected) {
  EXPECT_EQ(actual.size(), expected.size());
  double largest = 0;
  for (size_t i = 0; i < actual.size(); ++i) {
    const double error = std::abs(actual[i] - expected[i]);
    if (std::isnan(error)) return error;
    largest = std::max(largest, error);
  }
  return largest;
}

// One forward and backward pass and everything that comes out of it.
struct Pass {
  std::vector<Planes> R;
  Planes v_R0, v_N;
  PdmWeights v_weights;

  bool operator==(const Pass& other) const {
    for (size_t k = 0; k < R.size(); ++k) {
      if (R[k].data != other.R[k].data) return false;
    }
    return v_R0.data == other.v_R0.data && v_N.data == other.v_N.data &&
           v_weights.nets == other.v_weights.nets;
  }
};

Pass RunPass(Pdm* pdm, const PdmWeights& weights, const Planes& R0, const Planes& N,
             const Planes& v_last, const Planes& v_previous) {
  Pass pass;
  pdm->Forward(weights, R0, N);
  for (int k = 1; k <= pdm->options().stages; ++k) pass.R.push_back(pdm->R(k));
  pass.v_R0 = pass.v_N = Planes(3, R0.height, R0.width);
  pdm->Backward(v_last, v_previous, pass.v_R0, pass.v_N, &pass.v_weights);
  return pass;
}

std::vector<PdmOptions> Variants() {
  PdmOptions per_stage, clamped, one_stage, wide;
  per_stage.shared = false;
  per_stage.hidden = 5;
  per_stage.filter_size = 5;
  per_stage.filter_sigma = 1.0f;
  per_stage.border = PdmBorder::kZero;
  clamped.clamp_R = true;
  clamped.hidden = 8;
  one_stage.stages = 1;
  one_stage.hidden = 3;
  wide.stages = 4;
  wide.hidden = 18;
  wide.filter_size = 15;
  wide.filter_sigma = 3.0f;
  return {PdmOptions(), per_stage, clamped, one_stage, wide};
}

TEST(Pdm, MatchesTheEquationsOnEverySimdTargetAndOddSize) {
  // {height, width}: single pixels and lines, one more or less than any vector or block length, and
  // several bands of rows.
  const std::vector<std::pair<int, int>> sizes = {
      {1, 1},   {3, 5},  {1, 40}, {33, 1}, {2, 3},  {4, 7},  {5, 9},  {3, 15},
      {17, 17}, {4, 31}, {3, 33}, {2, 63}, {2, 65}, {3, 95}, {67, 6}, {129, 5}};
  for (const PdmOptions& options : Variants()) {
    const PdmWeights weights = RandomWeights(options);
    for (const auto& [height, width] : sizes) {
      SCOPED_TRACE(::testing::Message() << height << "x" << width << ", " << options.hidden);
      const Planes R0 = RandomPlanes(height, width, -0.2, 1.2, 0);
      const Planes N = RandomPlanes(height, width, -0.3, 0.3, 1);
      const auto expected = MakeOracle(options, weights, R0, N).Forward();
      ForEachTarget([&] {
        Pdm pdm(options, 1);
        pdm.Forward(weights, R0, N);
        for (int k = 1; k <= options.stages; ++k) {
          // 432 single-precision terms of size 1, three stages deep.
          EXPECT_LT(LargestError(pdm.R(k).data, expected[k - 1]), 1e-5) << "R_" << k;
        }
        Planes result;
        pdm.Apply(weights, R0, N, &result);
        EXPECT_EQ(result.data, pdm.R(options.stages).data);
      });
    }
  }
}

// Central differences of the double-precision oracle, entry by entry.
class FiniteDifferences {
 public:
  FiniteDifferences(const OraclePdm& oracle, const Planes& v_last, const Planes& v_previous)
      : oracle_(oracle), v_last_(v_last), v_previous_(v_previous) {}

  std::vector<double> OfR0() { return Gradient(&oracle_.R0); }
  std::vector<double> OfN() { return Gradient(&oracle_.N); }
  std::vector<double> OfNet(int k) { return Gradient(&oracle_.nets[k]); }

 private:
  double Loss() const {
    auto R = oracle_.Forward();
    R.insert(R.begin(), oracle_.R0);
    double loss = 0;
    for (size_t i = 0; i < v_last_.data.size(); ++i) {
      loss += v_last_.data[i] * R.back()[i];
      if (!v_previous_.empty()) loss += v_previous_.data[i] * R[R.size() - 2][i];
    }
    return loss;
  }

  std::vector<double> Gradient(std::vector<double>* variable) const {
    std::vector<double> gradient;
    for (double& v : *variable) {
      const double value = v, step = 1e-6;
      v = value + step;
      const double plus = Loss();
      v = value - step;
      gradient.push_back((plus - Loss()) / (2 * step));
      v = value;
    }
    return gradient;
  }

  OraclePdm oracle_;
  const Planes& v_last_;
  const Planes& v_previous_;
};

TEST(Pdm, BackwardMatchesFiniteDifferencesOfTheEquations) {
  for (PdmOptions options : Variants()) {
    options.hidden = std::min(options.hidden, 4);  // one difference per weight: keep them few
    for (const auto& [height, width] : {std::pair(1, 1), std::pair(3, 5), std::pair(2, 9)}) {
      SCOPED_TRACE(::testing::Message() << height << "x" << width << ", " << options.hidden);
      const PdmWeights weights = RandomWeights(options);
      const Planes R0 = RandomPlanes(height, width, -0.2, 1.2, 0);
      const Planes N = RandomPlanes(height, width, -0.3, 0.3, 1);
      const Planes v_last = RandomPlanes(height, width, -1, 1, 2);
      const Planes v_previous = options.clamp_R ? Planes() : RandomPlanes(height, width, -1, 1, 3);
      FiniteDifferences expected(MakeOracle(options, weights, R0, N), v_last, v_previous);
      const auto v_R0 = expected.OfR0(), v_N = expected.OfN();
      std::vector<std::vector<double>> v_nets;
      for (size_t k = 0; k < weights.nets.size(); ++k) v_nets.push_back(expected.OfNet(k));
      ForEachTarget([&] {
        Pdm pdm(options, 1);
        const Pass pass = RunPass(&pdm, weights, R0, N, v_last, v_previous);
        // Sums of up to a hundred single-precision terms of size 1.
        EXPECT_LT(LargestError(pass.v_R0.data, v_R0), 2e-5);
        EXPECT_LT(LargestError(pass.v_N.data, v_N), 2e-5);
        for (size_t k = 0; k < v_nets.size(); ++k) {
          EXPECT_LT(LargestError(pass.v_weights.nets[k], v_nets[k]), 2e-5) << "net " << k;
        }
      });
    }
  }
}

TEST(Pdm, GivesTheSameBytesForAnyNumberOfThreadsAndAgainAfterOtherSizes) {
  const PdmOptions options;
  const PdmWeights weights = RandomWeights(options);
  const Planes R0 = RandomPlanes(70, 83, 0, 1, 0), N = RandomPlanes(70, 83, -0.1, 0.1, 1);
  const Planes v_last = RandomPlanes(70, 83, -1, 1, 2), v_previous = RandomPlanes(70, 83, -1, 1, 3);
  const Planes small = RandomPlanes(9, 21, 0, 1, 4);
  Pdm one(options, 1);
  const Pass expected = RunPass(&one, weights, R0, N, v_last, v_previous);
  EXPECT_GT(expected.v_weights.nets[0][0], -1e9);  // not NaN: NaN is unequal to itself
  EXPECT_TRUE(RunPass(&one, weights, R0, N, v_last, v_previous) == expected);
  for (int threads : {2, 3, 7}) {
    Pdm pdm(options, threads);
    RunPass(&pdm, weights, small, small, small, small);
    EXPECT_TRUE(RunPass(&pdm, weights, R0, N, v_last, v_previous) == expected) << threads;
  }
}

TEST(PaddedRows, KeepTheirMemoryAndZerosAroundPicturesOfOtherSizes) {
  constexpr int kPad = PaddedRows::kPad;
  PaddedRows rows;
  rows.Resize(3, 48, 64);
  const float* const memory = rows.row(-1, 0);
  for (const auto& [height, width] : {std::pair(48, 64), std::pair(56, 40), std::pair(48, 64)}) {
    rows.Resize(3, height, width);
    EXPECT_EQ(rows.row(-1, 0), memory);
    const int right = static_cast<int>(rows.stride()) - kPad;
    for (int y = -1; y <= height; ++y) {
      for (int c = 0; c < 3; ++c) {
        float* const row = rows.row(y, c);
        for (int x = -kPad; x < right; ++x) {
          const bool inside = y >= 0 && y < height && x >= 0 && x < width;
          if (inside) {
            row[x] = NAN;
          } else {
            ASSERT_EQ(row[x], 0) << x << ", " << y;
          }
        }
      }
    }
  }
}

TEST(Pdm, GivesTheSameBytesAfterOtherSizes) {
  const PdmOptions options;
  const PdmWeights weights = RandomWeights(options);
  Pdm used(options, 1);
  for (const auto& [height, width] : {std::pair(48, 64), std::pair(56, 40), std::pair(48, 64)}) {
    const Planes R0 = RandomPlanes(height, width, 0, 1, 0),
                 v = RandomPlanes(height, width, -1, 1, 2);
    Pdm fresh(options, 1);
    EXPECT_TRUE(RunPass(&used, weights, R0, R0, v, v) == RunPass(&fresh, weights, R0, R0, v, v))
        << height;
  }
}

TEST(Pdm, GradientMayTakeThePlaceOfTheOneItComesFrom) {
  const PdmOptions options;
  const Planes R0 = RandomPlanes(33, 21, 0, 1, 0), v_last = RandomPlanes(33, 21, -1, 1, 2);
  Pdm pdm(options, 2);
  const Pass expected = RunPass(&pdm, RandomWeights(options), R0, R0, v_last, Planes());
  Planes v = v_last, v_N = v_last;
  PdmWeights v_weights;
  pdm.Backward(v, Planes(), v, v_N, &v_weights);
  EXPECT_EQ(v.data, expected.v_R0.data);
  EXPECT_EQ(v_N.data, expected.v_N.data);
}

TEST(Pdm, StartsAsAGentleSmoothingThatKeepsFlatImages) {
  const PdmOptions options;
  const PdmWeights weights = PdmWeights::Initial(options, 1);
  EXPECT_EQ(weights.nets, PdmWeights::Initial(options, 1).nets);
  EXPECT_NE(weights.nets, PdmWeights::Initial(options, 2).nets);

  Planes flat(3, 12, 20), checker(3, 12, 20);
  const Planes no_noise(3, 12, 20);
  for (size_t i = 0; i < flat.data.size(); ++i) {
    flat.data[i] = 0.4f;
    checker.data[i] = (i % 20 + i / 20) % 2 ? 0.5f : -0.5f;
  }
  Pdm pdm(options, 1);
  pdm.Forward(weights, flat, no_noise);
  for (float v : pdm.R(3).data) EXPECT_NEAR(v, 0.4f, 1e-6);

  pdm.Forward(weights, checker, no_noise);
  const double h = 1 - std::pow(0.7869860421615986 - 2 * 0.10650697891920076, 2);
  const double response = 1 - h + h * h - h * h * h / 2;
  EXPECT_NEAR(response, 0.63, 0.005);
  EXPECT_NEAR(pdm.R(3).at(1, 5, 7), response * checker.at(1, 5, 7), 1e-6);
}

TEST(PdmOptions, NamesTheFieldThatIsOutOfRange) {
  EXPECT_TRUE(PdmOptions().Validate().ok());
  auto message = [](auto change) {
    PdmOptions options;
    change(options);
    return std::string(options.Validate().message());
  };
  EXPECT_THAT(message([](PdmOptions& o) { o.stages = 0; }),
              HasSubstr("pdm_stages: 0 is not in [1, 8]"));
  EXPECT_THAT(message([](PdmOptions& o) { o.hidden = 65; }), HasSubstr("pdm_hidden: 65"));
  EXPECT_THAT(message([](PdmOptions& o) { o.filter_size = 4; }), HasSubstr("4 is not odd"));
  EXPECT_THAT(message([](PdmOptions& o) { o.filter_size = 17; }), HasSubstr("[1, 15]"));
  EXPECT_THAT(message([](PdmOptions& o) { o.filter_sigma = NAN; }), HasSubstr("filter_sigma"));
}

}  // namespace
}  // namespace litags
