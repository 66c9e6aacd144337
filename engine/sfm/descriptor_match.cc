#include "engine/sfm/descriptor_match.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/core/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/sfm/descriptor_match.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

#ifndef LITAGS_ENGINE_SFM_DESCRIPTOR_MATCH_ONCE_
#define LITAGS_ENGINE_SFM_DESCRIPTOR_MATCH_ONCE_
namespace litags {

// Two panels, 16 KiB, stay in a 32 KiB first level cache while their products are formed.
constexpr size_t kPanel = 32;                       // features
constexpr size_t kPairs = kDescriptorSize / 2;      // of dimensions
constexpr size_t kPanelSize = kPairs * kPanel * 2;  // int16
// Panels of `a` (256 KiB) that stay in the second level cache while all of `b` passes by.
constexpr size_t kBlockPanels = 32;
constexpr size_t kTileRows = 4, kTileVectors = 2;  // 8 sums and 2 operands fit in 16 registers

// Where the products of one photo's features are collected; `first` is the index of [0].
struct Collector {
  size_t first;
  int32_t *best, *second, *index;

  Collector At(size_t i) const { return {first + i, best + i, second + i, index + i}; }

  void Offer(size_t i, int32_t product, size_t other) const {
    if (product > best[i]) {
      second[i] = best[i];
      best[i] = product;
      index[i] = static_cast<int32_t>(other);
    } else if (product > second[i]) {
      second[i] = product;
    }
  }
};

}  // namespace litags
#endif  // LITAGS_ENGINE_SFM_DESCRIPTOR_MATCH_ONCE_

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D32 = hn::CappedTag<int32_t, kPanel / kTileVectors>;
using D16 = hn::Repartition<int16_t, D32>;
using V32 = hn::Vec<D32>;

// Collects one row of a tile: those products that are among the two largest of the row or of their
// column so far. They become rare: about 4 ln n of a row of n.
HWY_INLINE void CollectRow(V32 sum0, V32 sum1, size_t r, const Collector& rows,
                           const Collector& cols) {
  const D32 d;
  const size_t lanes = hn::Lanes(d);
  const V32 second = hn::Set(d, rows.second[r]);
  const auto counts = hn::Or(hn::Gt(sum0, hn::Min(second, hn::LoadU(d, cols.second))),
                             hn::Gt(sum1, hn::Min(second, hn::LoadU(d, cols.second + lanes))));
  if (HWY_LIKELY(hn::AllFalse(d, counts))) return;
  HWY_ALIGN int32_t products[kPanel];
  hn::Store(sum0, d, products);
  hn::Store(sum1, d, products + lanes);
  for (size_t c = 0; c < kTileVectors * lanes; ++c) {
    rows.Offer(r, products[c], cols.first + c);
    cols.Offer(c, products[c], rows.first + r);
  }
}

// Products of four features at `a` and two vectors of features at `b`.
HWY_INLINE void MultiplyTile(const int16_t* HWY_RESTRICT a, const int16_t* HWY_RESTRICT b,
                             const Collector& rows, const Collector& cols) {
  const D32 d32;
  const D16 d16;
  const size_t lanes = hn::Lanes(d32);
  // Where one instruction does not add neighbours, `odd` holds the other half of the sums.
  V32 s00 = hn::Zero(d32), s01 = s00, s10 = s00, s11 = s00, s20 = s00, s21 = s00, s30 = s00,
      s31 = s00;
  V32 o00 = s00, o01 = s00, o10 = s00, o11 = s00, o20 = s00, o21 = s00, o30 = s00, o31 = s00;
  const auto broadcast = [&](const int16_t* pair) HWY_ATTR {
    int32_t both;
    std::memcpy(&both, pair, sizeof(both));
    return hn::BitCast(d16, hn::Set(d32, both));
  };
  for (size_t k = 0; k < kPairs; ++k, a += 2 * kPanel, b += 2 * kPanel) {
    const auto b0 = hn::Load(d16, b), b1 = hn::Load(d16, b + 2 * lanes);
    const auto a0 = broadcast(a), a1 = broadcast(a + 2);
    s00 = hn::ReorderWidenMulAccumulate(d32, a0, b0, s00, o00);
    s01 = hn::ReorderWidenMulAccumulate(d32, a0, b1, s01, o01);
    s10 = hn::ReorderWidenMulAccumulate(d32, a1, b0, s10, o10);
    s11 = hn::ReorderWidenMulAccumulate(d32, a1, b1, s11, o11);
    const auto a2 = broadcast(a + 4), a3 = broadcast(a + 6);
    s20 = hn::ReorderWidenMulAccumulate(d32, a2, b0, s20, o20);
    s21 = hn::ReorderWidenMulAccumulate(d32, a2, b1, s21, o21);
    s30 = hn::ReorderWidenMulAccumulate(d32, a3, b0, s30, o30);
    s31 = hn::ReorderWidenMulAccumulate(d32, a3, b1, s31, o31);
  }
  const auto sum = [](V32 s, V32 o) HWY_ATTR { return hn::RearrangeToOddPlusEven(s, o); };
  CollectRow(sum(s00, o00), sum(s01, o01), 0, rows, cols);
  CollectRow(sum(s10, o10), sum(s11, o11), 1, rows, cols);
  CollectRow(sum(s20, o20), sum(s21, o21), 2, rows, cols);
  CollectRow(sum(s30, o30), sum(s31, o31), 3, rows, cols);
}

void MultiplyPanels(const int16_t* HWY_RESTRICT a, const int16_t* HWY_RESTRICT b,
                    const Collector& rows, const Collector& cols) {
  const size_t columns = kTileVectors * hn::Lanes(D32());
  for (size_t column = 0; column < kPanel; column += columns) {
    for (size_t row = 0; row < kPanel; row += kTileRows) {
      MultiplyTile(a + 2 * row, b + 2 * column, rows.At(row), cols.At(column));
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(MultiplyPanels);

// The angle between two descriptors as COLMAP computes it, in float.
float Distance(int32_t product) {
  constexpr float kNorm = 1.0f / (512.0f * 512.0f);
  return std::acos(std::min(kNorm * static_cast<float>(product), 1.0f));
}

bool IsDistinct(const NearestProducts& nearest, size_t i, const MatchRule& rule) {
  if (nearest.index[i] < 0) return false;
  const float distance = Distance(nearest.best[i]);
  return distance <= rule.max_distance && distance < rule.max_ratio * Distance(nearest.second[i]);
}

// Whole panels, so that a tile need not ask where the features end.
Collector Begin(size_t num_panels, int32_t floor, NearestProducts* nearest) {
  nearest->best.assign(num_panels * kPanel, floor);
  nearest->second.assign(num_panels * kPanel, floor);
  nearest->index.assign(num_panels * kPanel, -1);
  return {0, nearest->best.data(), nearest->second.data(), nearest->index.data()};
}

void End(size_t size, NearestProducts* nearest) {
  nearest->best.resize(size);
  nearest->second.resize(size);
  nearest->index.resize(size);
}

}  // namespace

PackedDescriptors::PackedDescriptors(absl::Span<const uint8_t> descriptors)
    : size_(descriptors.size() / kDescriptorSize),
      data_(hwy::AllocateAligned<int16_t>(std::max<size_t>(1, num_panels()) * kPanelSize)) {
  LITAGS_CHECK(descriptors.size() == size_ * kDescriptorSize);
  LITAGS_CHECK(data_ != nullptr);
  // Features that fill up the last panel are zero: their products never exceed a floor.
  std::fill_n(data_.get(), num_panels() * kPanelSize, int16_t{0});
  int16_t* to = data_.get();
  for (size_t panel = 0; panel < num_panels(); ++panel) {
    const uint8_t* from = descriptors.data() + panel * kPanel * kDescriptorSize;
    const size_t features = std::min(kPanel, size_ - panel * kPanel);
    for (size_t k = 0; k < kPairs; ++k, to += 2 * kPanel) {
      for (size_t i = 0; i < features; ++i) {
        to[2 * i] = from[i * kDescriptorSize + 2 * k];
        to[2 * i + 1] = from[i * kDescriptorSize + 2 * k + 1];
      }
    }
  }
}

size_t PackedDescriptors::num_panels() const { return (size_ + kPanel - 1) / kPanel; }

const int16_t* PackedDescriptors::panel(size_t i) const { return data_.get() + i * kPanelSize; }

void FindNearest(const PackedDescriptors& a, const PackedDescriptors& b, int32_t floor,
                 const CancelToken& cancel, NearestProducts* of_a, NearestProducts* of_b) {
  LITAGS_CHECK(floor >= 0);
  const Collector rows = Begin(a.num_panels(), floor, of_a);
  const Collector cols = Begin(b.num_panels(), floor, of_b);
  for (size_t block = 0; block < a.num_panels(); block += kBlockPanels) {
    if (cancel.IsCancelled()) break;
    const size_t end = std::min(block + kBlockPanels, a.num_panels());
    for (size_t j = 0; j < b.num_panels(); ++j) {
      for (size_t i = block; i < end; ++i) {
        HWY_DYNAMIC_DISPATCH(MultiplyPanels)
        (a.panel(i), b.panel(j), rows.At(i * kPanel), cols.At(j * kPanel));
      }
    }
  }
  End(a.size(), of_a);
  End(b.size(), of_b);
}

int32_t IrrelevantProduct(const MatchRule& rule) {
  // A best distance is at most max_distance, so a second best beyond max_distance / max_ratio
  // never fails the ratio test. One less for the rounding of acos in float (2e-7 rad, 0.05).
  const double farthest = std::min(double{rule.max_distance} / rule.max_ratio, 1.5707963267948966);
  return std::max(0, static_cast<int32_t>(std::cos(farthest) * 512 * 512) - 1);
}

std::vector<FeatureMatch> MatchDescriptors(const PackedDescriptors& a, const PackedDescriptors& b,
                                           const MatchRule& rule, const CancelToken& cancel) {
  NearestProducts of_a, of_b;
  FindNearest(a, b, IrrelevantProduct(rule), cancel, &of_a, &of_b);
  if (cancel.IsCancelled()) return {};
  std::vector<FeatureMatch> matches;
  for (size_t i = 0; i < a.size(); ++i) {
    if (!IsDistinct(of_a, i, rule)) continue;
    const size_t j = static_cast<size_t>(of_a.index[i]);
    if (of_b.index[j] == static_cast<int32_t>(i) && IsDistinct(of_b, j, rule)) {
      matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(j)});
    }
  }
  return matches;
}

}  // namespace litags
#endif  // HWY_ONCE
