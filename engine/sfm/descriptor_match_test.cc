#include "engine/sfm/descriptor_match.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/sfm/scalar_match.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

// n descriptors of about length 512 whose entries are as uneven as those of SIFT.
Descriptors RandomDescriptors(size_t n, uint64_t stream) {
  const CounterRng rng(17, stream);
  Descriptors all;
  for (size_t i = 0; i < n; ++i) {
    double values[kDescriptorSize], squares = 0;
    for (size_t k = 0; k < kDescriptorSize; ++k) {
      values[k] = std::pow(rng.Uniform(i * kDescriptorSize + k), 3);
      squares += values[k] * values[k];
    }
    for (const double value : values) {
      all.push_back(static_cast<uint8_t>(std::min(255.0, 512 * value / std::sqrt(squares))));
    }
  }
  return all;
}

// Every second descriptor of `from`, each entry off by up to `noise`.
Descriptors Resampled(const Descriptors& from, int noise) {
  const CounterRng rng(18, 0);
  Descriptors all;
  for (size_t i = 0; i < from.size(); ++i) {
    if (i / kDescriptorSize % 2 != 0) continue;
    const int off = static_cast<int>((2 * noise + 1) * rng.Uniform(i)) - noise;
    all.push_back(static_cast<uint8_t>(std::clamp(from[i] + off, 0, 255)));
  }
  return all;
}

void ExpectSame(const NearestProducts& got, const Descriptors& of, const Descriptors& in,
                int32_t floor) {
  const NearestProducts want = ScalarNearest(of, in, floor);
  EXPECT_EQ(got.best, want.best);
  EXPECT_EQ(got.second, want.second);
  ASSERT_EQ(got.index.size(), want.index.size());
  for (size_t i = 0; i < want.index.size(); ++i) {
    if (want.best[i] > want.second[i] || want.index[i] < 0) {
      EXPECT_EQ(got.index[i], want.index[i]);
    } else {  // a tie: any of the two
      ASSERT_GE(got.index[i], 0);
      EXPECT_EQ(Product(of, i, in, static_cast<size_t>(got.index[i])), want.best[i]);
    }
  }
}

void ExpectEqualsScalar(const Descriptors& a, const Descriptors& b, int32_t floor) {
  ForEachTarget([&] {
    NearestProducts of_a, of_b;
    FindNearest(PackedDescriptors(a), PackedDescriptors(b), floor, CancelToken(), &of_a, &of_b);
    ExpectSame(of_a, a, b, floor);
    ExpectSame(of_b, b, a, floor);
  });
}

TEST(FindNearest, EqualsTheScalarTwinForAnyNumberOfFeatures) {
  for (const size_t n : {0, 1, 3, 31, 32, 33, 70}) {
    for (const size_t m : {0, 1, 2, 15, 17, 64, 97}) {
      SCOPED_TRACE(std::to_string(n) + " x " + std::to_string(m));
      ExpectEqualsScalar(RandomDescriptors(n, 1), RandomDescriptors(m, 2), 0);
    }
  }
}

TEST(FindNearest, EqualsTheScalarTwinAcrossCacheBlocks) {
  ExpectEqualsScalar(RandomDescriptors(1061, 1), RandomDescriptors(41, 2), 0);
  ExpectEqualsScalar(RandomDescriptors(41, 1), RandomDescriptors(1061, 2), 0);
}

TEST(FindNearest, TiesLeaveNoDistance) {
  Descriptors twice = RandomDescriptors(20, 1);
  twice.insert(twice.end(), twice.begin(), twice.end());
  ExpectEqualsScalar(twice, RandomDescriptors(33, 2), 0);
  ExpectEqualsScalar(twice, twice, 0);
  ExpectEqualsScalar(Descriptors(50 * kDescriptorSize, 45), Descriptors(35 * kDescriptorSize, 45),
                     0);
}

TEST(FindNearest, ZeroDescriptorsHaveNoNearest) {
  Descriptors some = RandomDescriptors(40, 1);
  std::fill_n(some.begin() + 5 * kDescriptorSize, kDescriptorSize, uint8_t{0});
  ExpectEqualsScalar(some, RandomDescriptors(9, 2), 0);
  NearestProducts of_a, of_b;
  FindNearest(PackedDescriptors(some), PackedDescriptors(Descriptors(kDescriptorSize, 0)), 0,
              CancelToken(), &of_a, &of_b);
  EXPECT_EQ(of_a.index, std::vector<int32_t>(40, -1));
  EXPECT_EQ(of_b.index, std::vector<int32_t>(1, -1));
}

TEST(FindNearest, TheLargestEntriesDoNotOverflow) {
  const Descriptors white(33 * kDescriptorSize, 255);
  ExpectEqualsScalar(white, white, 0);
  NearestProducts of_a, of_b;
  FindNearest(PackedDescriptors(white), PackedDescriptors(white), 0, CancelToken(), &of_a, &of_b);
  EXPECT_EQ(of_a.best[0], 128 * 255 * 255);
}

TEST(FindNearest, OnlyProductsAboveTheFloorCount) {
  const Descriptors a = RandomDescriptors(60, 1), b = RandomDescriptors(60, 2);
  std::vector<int32_t> best = ScalarNearest(a, b, 0).best;
  std::sort(best.begin(), best.end());
  ExpectEqualsScalar(a, b, best[30]);  // itself no longer counts
  ExpectEqualsScalar(a, b, best[30] - 1);
  ExpectEqualsScalar(a, b, best.back());
}

TEST(MatchDescriptors, EqualsColmapsRuleWordByWord) {
  for (const int noise : {0, 8, 25, 60}) {
    const Descriptors a = RandomDescriptors(301, 1), b = Resampled(a, noise);
    for (const MatchRule rule :
         {MatchRule(), MatchRule{0.7f, 1.0f}, MatchRule{0.3f, 0.95f}, MatchRule{1.5f, 0.8f}}) {
      const std::vector<FeatureMatch> want = ScalarMatches(a, b, rule);
      ForEachTarget([&] {
        EXPECT_EQ(MatchDescriptors(PackedDescriptors(a), PackedDescriptors(b), rule, CancelToken()),
                  want);
      });
    }
    if (noise == 8) {
      EXPECT_EQ(ScalarMatches(a, b, MatchRule()).size(), 151u);  // all of b
    }
  }
}

TEST(MatchDescriptors, RepeatedFeaturesAreNoMatch) {
  const Descriptors once = RandomDescriptors(9, 1);
  Descriptors twice = once;
  twice.insert(twice.end(), once.begin() + kDescriptorSize, once.end());  // all but the first
  const auto matches = MatchDescriptors(PackedDescriptors(once), PackedDescriptors(twice),
                                        MatchRule(), CancelToken());
  EXPECT_EQ(matches, std::vector<FeatureMatch>({{0, 0}}));
}

TEST(MatchDescriptors, EndsEarlyWhenCancelled) {
  CancelToken cancel;
  cancel.Cancel();
  const PackedDescriptors a(RandomDescriptors(9, 1));
  EXPECT_TRUE(MatchDescriptors(a, a, MatchRule(), cancel).empty());
}

TEST(MatchRule, NoIgnoredProductCanChangeTheResult) {
  const MatchRule rule;
  const int32_t ignored = IrrelevantProduct(rule);
  const auto distance = [](int32_t product) { return std::acos(product / (512.0f * 512.0f)); };
  EXPECT_GT(distance(ignored), rule.max_distance);
  EXPECT_GT(rule.max_ratio * distance(ignored), rule.max_distance);
  EXPECT_LT(rule.max_ratio * distance(ignored + 10), rule.max_distance);  // but hardly more
  EXPECT_EQ(IrrelevantProduct({.max_distance = 1.5f, .max_ratio = 0.8f}), 0);
}

}  // namespace
}  // namespace litags
