#include "engine/prior/weighted_rows.h"

#include "engine/core/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/prior/weighted_rows.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "engine/core/simd-inl.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {

void SumRows(const float* const* rows, const float* weights, size_t taps, size_t n, float* out) {
  const FloatTag d;
  ForVectors(n, [&](size_t i, auto lanes) HWY_ATTR {
    auto sum = hn::Zero(d);
    for (size_t k = 0; k < taps; ++k) {
      sum = hn::Add(sum, hn::Mul(hn::Set(d, weights[k]), Load(d, rows[k] + i, lanes)));
    }
    Store(d, sum, out + i, lanes);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(SumRows);

void SumWeightedRows(absl::Span<const float* const> rows, absl::Span<const float> weights, size_t n,
                     float* out) {
  LITAGS_CHECK(rows.size() == weights.size());
  HWY_DYNAMIC_DISPATCH(SumRows)(rows.data(), weights.data(), weights.size(), n, out);
}

}  // namespace litags
#endif  // HWY_ONCE
