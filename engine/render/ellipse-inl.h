// Where an ellipse lies between two rows of pixels, per target. Include after highway.h.
#if defined(LITAGS_ENGINE_RENDER_ELLIPSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LITAGS_ENGINE_RENDER_ELLIPSE_INL_H_
#undef LITAGS_ENGINE_RENDER_ELLIPSE_INL_H_
#else
#define LITAGS_ENGINE_RENDER_ELLIPSE_INL_H_
#endif

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {

// The ellipse where alpha reaches 1/255, as projection.h's records have it.
template <class V>
struct Ellipse {
  V x, y;  // centre, px
  V half_height, shear, aspect, dy_right;
};

// Pixel columns [first, last] whose centres it covers in the pixel rows first_row .. last_row:
// exact, from where it is widest inside them, up to a margin for rounding. Columns are counted from
// the pixel at `origin`. Empty where first > last; not limited to any image.
template <class V>
struct Columns {
  V first, last;
};
template <class D, class V = hwy::HWY_NAMESPACE::Vec<D>>
HWY_INLINE Columns<V> ColumnsOfRows(D d, const Ellipse<V>& e, V first_row, V last_row,
                                    float origin) {
  namespace hn = hwy::HWY_NAMESPACE;
  const V half = hn::Set(d, 0.5f);
  const V lo = hn::Max(hn::Sub(hn::Add(first_row, half), e.y), hn::Neg(e.half_height));
  const V hi = hn::Min(hn::Sub(hn::Add(last_row, half), e.y), e.half_height);
  const V margin = hn::Set(d, 0.02f);  // covers rounding; costs nothing measurable
  const auto half_chord = [&](V dy) HWY_ATTR {
    const V inside = hn::NegMulAdd(dy, dy, hn::Mul(e.half_height, e.half_height));
    return hn::MulAdd(e.aspect, hn::Sqrt(hn::Max(inside, hn::Zero(d))), margin);
  };
  const V at_right = hn::Min(hn::Max(e.dy_right, lo), hi);
  const V at_left = hn::Min(hn::Max(hn::Neg(e.dy_right), lo), hi);
  const V center = hn::Sub(e.x, hn::Set(d, origin + 0.5f));
  const V right = hn::Add(hn::MulAdd(e.shear, at_right, center), half_chord(at_right));
  const V left = hn::Sub(hn::MulAdd(e.shear, at_left, center), half_chord(at_left));
  return {hn::Ceil(left), hn::IfThenElse(hn::Le(lo, hi), hn::Floor(right), hn::Set(d, -1e9f))};
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#endif  // LITAGS_ENGINE_RENDER_ELLIPSE_INL_H_
