// Real spherical harmonics to degree 3 over SIMD lanes, signs as in 3DGS (basis 1..3 = -y, z, -x).
// Constants: the usual real SH normalisation, e.g. Sloan, "Stupid SH Tricks", 2008.
#if defined(LITAGS_ENGINE_RENDER_SH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LITAGS_ENGINE_RENDER_SH_INL_H_
#undef LITAGS_ENGINE_RENDER_SH_INL_H_
#else
#define LITAGS_ENGINE_RENDER_SH_INL_H_
#endif

#include "engine/core/splats.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr float kSh1 = 0.4886025119029199f;
constexpr float kSh2[5] = {1.0925484305920792f, -1.0925484305920792f, 0.31539156525252005f,
                           -1.0925484305920792f, 0.5462742152960396f};
constexpr float kSh3[7] = {-0.5900435899266435f, 2.890611442640554f,   -0.4570457994644658f,
                           0.3731763325901154f,  -0.4570457994644658f, 1.445305721320277f,
                           -0.5900435899266435f};

// Calls f(k, basis_k) for k = 0 .. (degree + 1)^2 - 1 at the unit direction (x, y, z).
template <class D, class V, class F>
HWY_INLINE void ForEachShBasis(D d, int degree, V x, V y, V z, F&& f) {
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  f(0, set(float{kSh0}));
  if (degree < 1) return;
  f(1, hn::Mul(set(-kSh1), y));
  f(2, hn::Mul(set(kSh1), z));
  f(3, hn::Mul(set(-kSh1), x));
  if (degree < 2) return;
  const V xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
  const V xy = hn::Mul(x, y), yz = hn::Mul(y, z), xz = hn::Mul(x, z);
  f(4, hn::Mul(set(kSh2[0]), xy));
  f(5, hn::Mul(set(kSh2[1]), yz));
  f(6, hn::Mul(set(kSh2[2]), hn::Sub(hn::Sub(hn::Add(zz, zz), xx), yy)));
  f(7, hn::Mul(set(kSh2[3]), xz));
  f(8, hn::Mul(set(kSh2[4]), hn::Sub(xx, yy)));
  if (degree < 3) return;
  const V three = set(3.0f), four_zz = hn::Mul(set(4.0f), zz);
  f(9, hn::Mul(hn::Mul(set(kSh3[0]), y), hn::MulSub(three, xx, yy)));
  f(10, hn::Mul(hn::Mul(set(kSh3[1]), xy), z));
  f(11, hn::Mul(hn::Mul(set(kSh3[2]), y), hn::Sub(hn::Sub(four_zz, xx), yy)));
  f(12, hn::Mul(hn::Mul(set(kSh3[3]), z), hn::NegMulAdd(three, hn::Add(xx, yy), hn::Add(zz, zz))));
  f(13, hn::Mul(hn::Mul(set(kSh3[4]), x), hn::Sub(hn::Sub(four_zz, xx), yy)));
  f(14, hn::Mul(hn::Mul(set(kSh3[5]), z), hn::Sub(xx, yy)));
  f(15, hn::Mul(hn::Mul(set(kSh3[6]), x), hn::NegMulAdd(three, yy, xx)));
}

// color[c] = 0.5 + sum_k basis_k coefficient_{k,c}. `in` points at the lanes inside a block.
template <class D, class V>
HWY_INLINE void ShEval(D d, int degree, V x, V y, V z, const float* in, V* color) {
  for (int c = 0; c < 3; ++c) color[c] = hn::Set(d, 0.5f);
  ForEachShBasis(d, degree, x, y, z, [&](int k, V basis) HWY_ATTR {
    for (int c = 0; c < 3; ++c) {
      color[c] = hn::MulAdd(basis, hn::Load(d, in + ShRow(k, c) * kSplatBlock), color[c]);
    }
  });
}

// VJP of ShEval: stores the coefficients' gradients into `grads` (same layout as `in`) and
// dL/d(direction), before normalisation, into v_dir.
template <class D, class V>
HWY_INLINE void ShEvalVjp(D d, int degree, V x, V y, V z, const float* in, const V* v_color,
                          float* grads, V* v_dir) {
  ForEachShBasis(d, degree, x, y, z, [&](int k, V basis) HWY_ATTR {
    for (int c = 0; c < 3; ++c) {
      hn::Store(hn::Mul(basis, v_color[c]), d, grads + ShRow(k, c) * kSplatBlock);
    }
  });
  for (int i = 0; i < 3; ++i) v_dir[i] = hn::Zero(d);
  if (degree < 1) return;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  // w_k = dL/dbasis_k.
  const auto weight = [&](int k) HWY_ATTR {
    V w = hn::Mul(v_color[0], hn::Load(d, in + ShRow(k, 0) * kSplatBlock));
    w = hn::MulAdd(v_color[1], hn::Load(d, in + ShRow(k, 1) * kSplatBlock), w);
    return hn::MulAdd(v_color[2], hn::Load(d, in + ShRow(k, 2) * kSplatBlock), w);
  };
  V gx = hn::Mul(set(-kSh1), weight(3)), gy = hn::Mul(set(-kSh1), weight(1)),
    gz = hn::Mul(set(kSh1), weight(2));
  const auto add = [&](V* g, float scale, V w, V factor)
                       HWY_ATTR { *g = hn::MulAdd(hn::Mul(set(scale), w), factor, *g); };
  if (degree >= 2) {
    const V w4 = weight(4), w5 = weight(5), w6 = weight(6), w7 = weight(7), w8 = weight(8);
    add(&gx, kSh2[0], w4, y);
    add(&gy, kSh2[0], w4, x);
    add(&gy, kSh2[1], w5, z);
    add(&gz, kSh2[1], w5, y);
    add(&gx, -2 * kSh2[2], w6, x);
    add(&gy, -2 * kSh2[2], w6, y);
    add(&gz, 4 * kSh2[2], w6, z);
    add(&gx, kSh2[3], w7, z);
    add(&gz, kSh2[3], w7, x);
    add(&gx, 2 * kSh2[4], w8, x);
    add(&gy, -2 * kSh2[4], w8, y);
  }
  if (degree >= 3) {
    const V xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
    const V xy = hn::Mul(x, y), yz = hn::Mul(y, z), xz = hn::Mul(x, z);
    const V w9 = weight(9), w10 = weight(10), w11 = weight(11), w12 = weight(12), w13 = weight(13),
            w14 = weight(14), w15 = weight(15);
    const V xx_yy = hn::Sub(xx, yy), four_zz = hn::Mul(set(4.0f), zz);
    add(&gx, 6 * kSh3[0], w9, xy);
    add(&gy, 3 * kSh3[0], w9, xx_yy);
    add(&gx, kSh3[1], w10, yz);
    add(&gy, kSh3[1], w10, xz);
    add(&gz, kSh3[1], w10, xy);
    add(&gx, -2 * kSh3[2], w11, xy);
    add(&gy, kSh3[2], w11, hn::NegMulAdd(set(3.0f), yy, hn::Sub(four_zz, xx)));
    add(&gz, 8 * kSh3[2], w11, yz);
    add(&gx, -6 * kSh3[3], w12, xz);
    add(&gy, -6 * kSh3[3], w12, yz);
    add(&gz, 3 * kSh3[3], w12, hn::Sub(hn::Sub(hn::Add(zz, zz), xx), yy));
    add(&gx, kSh3[4], w13, hn::NegMulAdd(set(3.0f), xx, hn::Sub(four_zz, yy)));
    add(&gy, -2 * kSh3[4], w13, xy);
    add(&gz, 8 * kSh3[4], w13, xz);
    add(&gx, 2 * kSh3[5], w14, xz);
    add(&gy, -2 * kSh3[5], w14, yz);
    add(&gz, kSh3[5], w14, xx_yy);
    add(&gx, 3 * kSh3[6], w15, xx_yy);
    add(&gy, -6 * kSh3[6], w15, xy);
  }
  v_dir[0] = gx;
  v_dir[1] = gy;
  v_dir[2] = gz;
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#endif  // LITAGS_ENGINE_RENDER_SH_INL_H_
