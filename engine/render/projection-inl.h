// What the projection of Gaussians and its VJP share, per target. Include after highway.h.
#if defined(LITAGS_ENGINE_RENDER_PROJECTION_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LITAGS_ENGINE_RENDER_PROJECTION_INL_H_
#undef LITAGS_ENGINE_RENDER_PROJECTION_INL_H_
#else
#define LITAGS_ENGINE_RENDER_PROJECTION_INL_H_
#endif

#include "engine/render/constants.h"
#include "engine/render/projection.h"
#include "engine/render/sh-inl.h"
#include "hwy/contrib/math/math-inl.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kSplatBlock>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

struct V3 {
  V x, y, z;
};

HWY_INLINE V Dot(const V3& a, const V3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE V3 Scale(const V3& a, V s) {
  return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}
// a + s b
HWY_INLINE V3 Axpy(V s, const V3& b, const V3& a) {
  return {hn::MulAdd(s, b.x, a.x), hn::MulAdd(s, b.y, a.y), hn::MulAdd(s, b.z, a.z)};
}

// Everything the forward pass derives and the VJP needs again.
struct Lanes {
  V3 p;              // mean in camera coordinates
  V inv_z, u, v;     // X/Z and Y/Z, limited
  M u_free, v_free;  // where the limit does not act
  V3 scale;
  V qw, qx, qy, qz, inv_qnorm;
  V rot[9];                       // rotation of the quaternion, row-major
  V3 U0, U1, U2;                  // rows of W R S
  V s0, s1;                       // fx / Z, fy / Z
  V3 T0, T1;                      // rows of J W R S
  V eps;                          // added to the diagonal of T T^T
  V sharp_a, sharp_c, sharp_det;  // of T T^T; cov_b is its own
  V cov_a, cov_b, cov_c, det;
};

// Rotation matrix of a unit quaternion wxyz, row-major.
HWY_INLINE void QuatToRot(V w, V x, V y, V z, V* r) {
  const D d;
  const V one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
  const V xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
  const V xy = hn::Mul(x, y), xz = hn::Mul(x, z), yz = hn::Mul(y, z);
  const V wx = hn::Mul(w, x), wy = hn::Mul(w, y), wz = hn::Mul(w, z);
  r[0] = hn::NegMulAdd(two, hn::Add(yy, zz), one);
  r[1] = hn::Mul(two, hn::Sub(xy, wz));
  r[2] = hn::Mul(two, hn::Add(xz, wy));
  r[3] = hn::Mul(two, hn::Add(xy, wz));
  r[4] = hn::NegMulAdd(two, hn::Add(xx, zz), one);
  r[5] = hn::Mul(two, hn::Sub(yz, wx));
  r[6] = hn::Mul(two, hn::Sub(xz, wy));
  r[7] = hn::Mul(two, hn::Add(yz, wx));
  r[8] = hn::NegMulAdd(two, hn::Add(xx, yy), one);
}

HWY_INLINE V3 LoadMean(const float* in) {
  const D d;
  return {hn::Load(d, in + kMean * kSplatBlock), hn::Load(d, in + (kMean + 1) * kSplatBlock),
          hn::Load(d, in + (kMean + 2) * kSplatBlock)};
}

HWY_INLINE V3 ToCamera(const V3& m, const KernelCamera& cam) {
  const D d;
  auto row = [&](int i) HWY_ATTR {
    return hn::MulAdd(
        hn::Set(d, cam.R[3 * i]), m.x,
        hn::MulAdd(hn::Set(d, cam.R[3 * i + 1]), m.y,
                   hn::MulAdd(hn::Set(d, cam.R[3 * i + 2]), m.z, hn::Set(d, cam.t[i]))));
  };
  return {row(0), row(1), row(2)};
}

// Unit vector from the camera centre to the mean, and the inverse distance.
HWY_INLINE V3 Direction(const V3& m, const KernelCamera& cam, V* inv_distance) {
  const D d;
  const V3 v = {hn::Sub(m.x, hn::Set(d, cam.center[0])), hn::Sub(m.y, hn::Set(d, cam.center[1])),
                hn::Sub(m.z, hn::Set(d, cam.center[2]))};
  const V norm2 = hn::Max(Dot(v, v), hn::Set(d, 1e-24f));
  *inv_distance = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(norm2));
  return Scale(v, *inv_distance);
}

// What a lamp does to colours at this distance.
HWY_INLINE V LampGain(const Lamp& lamp, V inv_distance) {
  const D d;
  const V nearness = hn::Mul(hn::Set(d, lamp.distance), inv_distance);
  return hn::Exp(d, hn::Mul(hn::Set(d, lamp.power), hn::Log(d, nearness)));
}

// LITA-GS Eq. 1: Sigma = R S S^T R^T. Eq. 8: Sigma2D = J W Sigma W^T J^T = T T^T, T = J W R S.
// `in` points at the lanes of one vector inside a block. Lanes at or behind the camera give
// numbers without meaning; callers mask them.
HWY_INLINE Lanes ProjectLanes(const float* in, const V3& p, const KernelCamera& cam,
                              PixelFilter filter) {
  const D d;
  const auto load = [&](int row) HWY_ATTR { return hn::Load(d, in + row * kSplatBlock); };
  const V one = hn::Set(d, 1.0f);
  Lanes o;
  o.p = p;
  o.inv_z = hn::Div(one, p.z);
  const V u = hn::Mul(p.x, o.inv_z), v = hn::Mul(p.y, o.inv_z);
  o.u = hn::Min(hn::Max(u, hn::Set(d, cam.min_u)), hn::Set(d, cam.max_u));
  o.v = hn::Min(hn::Max(v, hn::Set(d, cam.min_v)), hn::Set(d, cam.max_v));
  o.u_free = hn::Eq(o.u, u);
  o.v_free = hn::Eq(o.v, v);

  o.scale = {hn::Exp(d, load(kLogScale)), hn::Exp(d, load(kLogScale + 1)),
             hn::Exp(d, load(kLogScale + 2))};
  const V w = load(kRawQuat), x = load(kRawQuat + 1), y = load(kRawQuat + 2),
          z = load(kRawQuat + 3);
  const V norm2 = hn::MulAdd(w, w, hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z))));
  o.inv_qnorm = hn::Div(one, hn::Sqrt(hn::Max(norm2, hn::Set(d, 1e-24f))));
  o.qw = hn::Mul(w, o.inv_qnorm);
  o.qx = hn::Mul(x, o.inv_qnorm);
  o.qy = hn::Mul(y, o.inv_qnorm);
  o.qz = hn::Mul(z, o.inv_qnorm);
  QuatToRot(o.qw, o.qx, o.qy, o.qz, o.rot);

  // Rows of U = W (R S).
  const V rs[9] = {
      hn::Mul(o.rot[0], o.scale.x), hn::Mul(o.rot[1], o.scale.y), hn::Mul(o.rot[2], o.scale.z),
      hn::Mul(o.rot[3], o.scale.x), hn::Mul(o.rot[4], o.scale.y), hn::Mul(o.rot[5], o.scale.z),
      hn::Mul(o.rot[6], o.scale.x), hn::Mul(o.rot[7], o.scale.y), hn::Mul(o.rot[8], o.scale.z)};
  auto row = [&](int i) HWY_ATTR {
    const V a = hn::Set(d, cam.R[3 * i]), b = hn::Set(d, cam.R[3 * i + 1]),
            c = hn::Set(d, cam.R[3 * i + 2]);
    return V3{hn::MulAdd(a, rs[0], hn::MulAdd(b, rs[3], hn::Mul(c, rs[6]))),
              hn::MulAdd(a, rs[1], hn::MulAdd(b, rs[4], hn::Mul(c, rs[7]))),
              hn::MulAdd(a, rs[2], hn::MulAdd(b, rs[5], hn::Mul(c, rs[8])))};
  };
  o.U0 = row(0);
  o.U1 = row(1);
  o.U2 = row(2);
  // Rows of T = J U with J = [fx/Z, 0, -fx/Z u; 0, fy/Z, -fy/Z v].
  o.s0 = hn::Mul(hn::Set(d, cam.fx), o.inv_z);
  o.s1 = hn::Mul(hn::Set(d, cam.fy), o.inv_z);
  o.T0 = Scale(Axpy(hn::Neg(o.u), o.U2, o.U0), o.s0);
  o.T1 = Scale(Axpy(hn::Neg(o.v), o.U2, o.U1), o.s1);

  o.eps = hn::Set(d, filter == PixelFilter::kMip ? kMipEps2d : kEps2d);
  o.sharp_a = Dot(o.T0, o.T0);
  o.sharp_c = Dot(o.T1, o.T1);
  o.cov_a = hn::Add(o.sharp_a, o.eps);
  o.cov_b = Dot(o.T0, o.T1);
  o.cov_c = hn::Add(o.sharp_c, o.eps);
  // a c - b^2 by Lagrange's identity, |T0 x T1|^2 + eps (|T0|^2 + |T1|^2) + eps^2: the plain
  // difference loses all digits for long thin Gaussians.
  const V3 cross = {hn::MulSub(o.T0.y, o.T1.z, hn::Mul(o.T0.z, o.T1.y)),
                    hn::MulSub(o.T0.z, o.T1.x, hn::Mul(o.T0.x, o.T1.z)),
                    hn::MulSub(o.T0.x, o.T1.y, hn::Mul(o.T0.y, o.T1.x))};
  o.sharp_det = Dot(cross, cross);
  o.det = hn::MulAdd(o.eps, hn::Add(o.cov_a, o.sharp_c), o.sharp_det);
  return o;
}

// |Cov| / |Cov + eps I| of PixelFilter::kMip. Where it is cut nothing is visible: alpha is below
// 1/255 even where Dropout makes up for nine tenths left out.
HWY_INLINE V AreaRatio(const Lanes& o) {
  const D d;
  return hn::Max(hn::Div(o.sharp_det, o.det), hn::Set(d, 1e-7f));
}

// ln sigmoid(x), without overflow on either side.
HWY_INLINE V LogSigmoid(V x) {
  const D d;
  return hn::Sub(hn::Min(x, hn::Zero(d)), hn::Log1p(d, hn::Exp(d, hn::Neg(hn::Abs(x)))));
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#endif  // LITAGS_ENGINE_RENDER_PROJECTION_INL_H_
