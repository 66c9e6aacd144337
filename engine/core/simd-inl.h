// Vector loops shared by kernels over image rows. Included once per Highway target.
#if defined(LITAGS_ENGINE_CORE_SIMD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LITAGS_ENGINE_CORE_SIMD_INL_H_
#undef LITAGS_ENGINE_CORE_SIMD_INL_H_
#else
#define LITAGS_ENGINE_CORE_SIMD_INL_H_
#endif

#include <cstddef>
#include <cstring>

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 16 lanes: scratch rows are padded to a multiple of 16.
using FloatTag = HWY_CAPPED(float, 16);
using FloatVec = hn::Vec<FloatTag>;

// Marks a full vector in ForVectors.
struct AllLanes {};

HWY_INLINE FloatVec Load(FloatTag d, const float* p, AllLanes) { return hn::LoadU(d, p); }
HWY_INLINE void Store(FloatTag d, FloatVec v, float* p, AllLanes) { hn::StoreU(v, d, p); }

// The first `count` lanes; the others are read as 0 and not written.
HWY_INLINE FloatVec Load(FloatTag d, const float* p, size_t count) {
  HWY_ALIGN float lanes[16] = {};
  std::memcpy(lanes, p, count * sizeof(float));
  return hn::Load(d, lanes);
}
HWY_INLINE void Store(FloatTag d, FloatVec v, float* p, size_t count) {
  HWY_ALIGN float lanes[16];
  hn::Store(v, d, lanes);
  std::memcpy(p, lanes, count * sizeof(float));
}

// body(i, lanes) for i = 0, N, 2N...; `lanes` is AllLanes or, for the rest, their number: pass it
// to Load and Store.
template <class Body>
HWY_INLINE void ForVectors(size_t n, const Body& body) {
  const size_t step = hn::Lanes(FloatTag());
  size_t i = 0;
  for (; i + step <= n; i += step) body(i, AllLanes());
  if (i < n) body(i, n - i);
}

// -1, 0 or 1.
HWY_INLINE FloatVec Sign(FloatTag d, FloatVec v) {
  return hn::IfThenZeroElse(hn::Eq(v, hn::Zero(d)), hn::CopySign(hn::Set(d, 1.0f), v));
}

HWY_INLINE float Sum(FloatTag d, FloatVec v) { return hn::GetLane(hn::SumOfLanes(d, v)); }

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#endif  // LITAGS_ENGINE_CORE_SIMD_INL_H_
