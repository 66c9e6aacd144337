#include "engine/render/projection.h"

#include <algorithm>
#include <cmath>

#include "engine/render/constants.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/projection.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"
// After highway.h: these define per-target code.
#include "engine/render/ellipse-inl.h"
#include "engine/render/sh-inl.h"
#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kSplatBlock>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

constexpr float kLog2E = 1.44269504f;
constexpr float kLog2Of255 = 7.99435344f;

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
  V rot[9];       // rotation of the quaternion, row-major
  V3 U0, U1, U2;  // rows of W R S
  V s0, s1;       // fx / Z, fy / Z
  V3 T0, T1;      // rows of J W R S
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

// `in` points at the lanes of one vector inside a block. Lanes at or behind the camera give
// numbers without meaning; callers mask them.
HWY_INLINE Lanes ProjectLanes(const float* in, const V3& p, const KernelCamera& cam) {
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

  const V eps = hn::Set(d, kEps2d);
  const V t00 = Dot(o.T0, o.T0), t11 = Dot(o.T1, o.T1);
  o.cov_a = hn::Add(t00, eps);
  o.cov_b = Dot(o.T0, o.T1);
  o.cov_c = hn::Add(t11, eps);
  // a c - b^2 by Lagrange's identity, |T0 x T1|^2 + eps (|T0|^2 + |T1|^2) + eps^2: the plain
  // difference loses all digits for long thin Gaussians.
  const V3 cross = {hn::MulSub(o.T0.y, o.T1.z, hn::Mul(o.T0.z, o.T1.y)),
                    hn::MulSub(o.T0.z, o.T1.x, hn::Mul(o.T0.x, o.T1.z)),
                    hn::MulSub(o.T0.x, o.T1.y, hn::Mul(o.T0.y, o.T1.x))};
  o.det = hn::MulAdd(eps, hn::Add(hn::Add(t00, t11), eps), Dot(cross, cross));
  return o;
}

// ln sigmoid(x), without overflow on either side.
HWY_INLINE V LogSigmoid(V x) {
  const D d;
  return hn::Sub(hn::Min(x, hn::Zero(d)), hn::Log1p(d, hn::Exp(d, hn::Neg(hn::Abs(x)))));
}

// Pixel range [first, last] whose centres lie in mid +- half, limited to the image; empty if
// first > last. NaN gives an empty range.
HWY_INLINE void PixelRange(V mid, V half, float size, V* first, V* last) {
  const D d;
  const V shifted = hn::Sub(mid, hn::Set(d, 0.5f));
  const V lo = hn::Ceil(hn::Sub(shifted, half)), hi = hn::Floor(hn::Add(shifted, half));
  *first = hn::IfThenElse(hn::Ge(lo, hn::Zero(d)), lo, hn::Zero(d));
  *last = hn::IfThenElse(hn::Le(hi, hn::Set(d, size - 1)), hi, hn::Set(d, size - 1));
  const M number = hn::Le(lo, hi);
  *last = hn::IfThenElse(number, *last, hn::Set(d, -1.0f));
}

// Writes what the lanes of `offset` contribute to records, depths and boxes.
void ProjectVector(const float* in, size_t first, size_t count, const KernelCamera& cam,
                   const ProjectionSettings& settings, ProjectedSplats* out) {
  const D d;
  constexpr size_t kLanes = kSplatBlock;  // upper bound, for the buffers
  const size_t lanes = hn::Lanes(d);
  const V3 mean = LoadMean(in);
  const V3 p = ToCamera(mean, cam);
  const M in_front = hn::Gt(p.z, hn::Set(d, settings.near_plane));
  const auto clear = [&]() {
    for (size_t i = 0; i < count; ++i) out->boxes[first + i] = {};
  };
  if (hn::AllFalse(d, in_front)) return clear();

  const Lanes o = ProjectLanes(in, p, cam);
  const V log2_opacity =
      hn::Mul(hn::Set(d, kLog2E), LogSigmoid(hn::Load(d, in + kLogitOpacity * kSplatBlock)));
  // alpha >= 1/255 inside d^T conic d <= q.
  const V q = hn::Mul(hn::Set(d, 2.0f / kLog2E), hn::Add(log2_opacity, hn::Set(d, kLog2Of255)));
  // A little wider than exact: rounding must not lose a pixel at the rim.
  const V q_wide = hn::MulAdd(q, hn::Set(d, 1e-4f), hn::Add(q, hn::Set(d, 1e-4f)));
  const V half_w = hn::Sqrt(hn::Mul(q_wide, o.cov_a)), half_h = hn::Sqrt(hn::Mul(q_wide, o.cov_c));
  const V x = hn::MulAdd(hn::Mul(p.x, o.inv_z), hn::Set(d, cam.fx), hn::Set(d, cam.cx));
  const V y = hn::MulAdd(hn::Mul(p.y, o.inv_z), hn::Set(d, cam.fy), hn::Set(d, cam.cy));
  V x0, x1, y0, y1;
  PixelRange(x, half_w, cam.width, &x0, &x1);
  PixelRange(y, half_h, cam.height, &y0, &y1);
  const M visible =
      hn::And(hn::And(in_front, hn::Gt(q, hn::Zero(d))), hn::And(hn::Le(x0, x1), hn::Le(y0, y1)));
  if (hn::AllFalse(d, visible)) return clear();

  const V inv_det = hn::Div(hn::Set(d, 1.0f), o.det);
  const V half_log2e = hn::Set(d, -0.5f * kLog2E);
  HWY_ALIGN float rec[kRecordFeatures + kNumChannels][kLanes];
  hn::Store(x, d, rec[kRecordX]);
  hn::Store(y, d, rec[kRecordY]);
  hn::Store(hn::Mul(half_log2e, hn::Mul(o.cov_c, inv_det)), d, rec[kRecordA]);
  hn::Store(hn::Mul(hn::Set(d, kLog2E), hn::Mul(o.cov_b, inv_det)), d, rec[kRecordB]);
  hn::Store(hn::Mul(half_log2e, hn::Mul(o.cov_a, inv_det)), d, rec[kRecordC]);
  hn::Store(log2_opacity, d, rec[kRecordLog2Opacity]);

  V inv_distance;
  const V3 dir = Direction(mean, cam, &inv_distance);
  V color[3];
  ShEval(d, settings.sh_degree, dir.x, dir.y, dir.z, in, color);
  for (int c = 0; c < 3; ++c) hn::Store(color[c], d, rec[kRecordFeatures + c]);
  if (settings.channels == kNumChannels) {
    const V composited = settings.depth_is_camera_z ? p.z : hn::Load(d, in + kDepth * kSplatBlock);
    hn::Store(composited, d, rec[kRecordFeatures + kChannelDepth]);
    static_assert(kIllumination - kStructure == kChannelIllumination - kChannelStructure);
    for (int r = kStructure; r < kIllumination + 3; ++r) {
      hn::Store(hn::Load(d, in + r * kSplatBlock), d,
                rec[kRecordFeatures + kChannelStructure + (r - kStructure)]);
    }
  } else if (settings.channels == kColorAndNoise) {
    for (int c = 0; c < 3; ++c) {
      hn::Store(hn::Load(d, in + (kNoise + c) * kSplatBlock), d, rec[kRecordFeatures + 3 + c]);
    }
  }

  const Ellipse<V> ellipse = {x,
                              y,
                              half_h,
                              hn::Div(o.cov_b, o.cov_c),
                              hn::Div(hn::Sqrt(o.det), o.cov_c),
                              hn::Mul(o.cov_b, hn::Sqrt(hn::Div(q_wide, o.cov_a)))};
  hn::Store(ellipse.half_height, d, rec[kRecordHalfHeight]);
  hn::Store(ellipse.shear, d, rec[kRecordShear]);
  hn::Store(ellipse.aspect, d, rec[kRecordAspect]);
  hn::Store(ellipse.dy_right, d, rec[kRecordDyRight]);
  HWY_ALIGN float span_first[ProjectedSplats::kSpanRows][kLanes];
  HWY_ALIGN float span_last[ProjectedSplats::kSpanRows][kLanes];
  const V tile = hn::Set(d, static_cast<float>(kTileSize));
  for (int row = 0; row < ProjectedSplats::kSpanRows; ++row) {
    const V top =
        hn::Mul(hn::Add(hn::Floor(hn::Div(y0, tile)), hn::Set(d, static_cast<float>(row))), tile);
    const Columns<V> columns =
        ColumnsOfRows(d, ellipse, top, hn::Add(top, hn::Set(d, kTileSize - 1.0f)), 0.0f);
    // Limited to the box; numbers that are not finite give all of it.
    const V first = hn::IfThenElse(hn::Ge(columns.first, x0), columns.first, x0);
    const V last = hn::IfThenElse(hn::Le(columns.last, x1), columns.last, x1);
    const M some = hn::Le(first, last);
    hn::Store(hn::IfThenElseZero(some, hn::Floor(hn::Div(first, tile))), d, span_first[row]);
    hn::Store(hn::IfThenElse(some, hn::Floor(hn::Div(last, tile)), hn::Set(d, -1.0f)), d,
              span_last[row]);
  }
  HWY_ALIGN float depth[kLanes], box_x0[kLanes], box_x1[kLanes], box_y0[kLanes], box_y1[kLanes];
  hn::Store(p.z, d, depth);
  hn::Store(x0, d, box_x0);
  hn::Store(x1, d, box_x1);
  hn::Store(y0, d, box_y0);
  hn::Store(y1, d, box_y1);
  HWY_ALIGN float seen[kLanes];
  hn::Store(hn::IfThenElseZero(visible, hn::Set(d, 1.0f)), d, seen);

  const int stride = RecordStride(settings.channels);
  const int used = kRecordFeatures + settings.channels;
  for (size_t i = 0; i < std::min(count, lanes); ++i) {
    ProjectedSplats::Box& box = out->boxes[first + i];
    box = {};
    if (seen[i] == 0.0f) continue;
    box = {static_cast<int16_t>(box_x0[i]), static_cast<int16_t>(box_x1[i]),
           static_cast<int16_t>(box_y0[i]), static_cast<int16_t>(box_y1[i])};
    ProjectedSplats::Spans& spans = out->spans[first + i];
    for (int row = 0; row < ProjectedSplats::kSpanRows; ++row) {
      spans.first[row] = static_cast<int16_t>(span_first[row][i]);
      spans.last[row] = static_cast<int16_t>(span_last[row][i]);
    }
    out->depths[first + i] = depth[i];
    float* record = out->records.data() + (first + i) * stride;
    for (int f = 0; f < used; ++f) record[f] = rec[f][i];
  }
}

void ProjectBlockImpl(const Splats& splats, size_t block, const KernelCamera& camera,
                      const ProjectionSettings& settings, ProjectedSplats* out) {
  const size_t lanes = hn::Lanes(D());
  const size_t begin = block * kSplatBlock, end = std::min(splats.size(), begin + kSplatBlock);
  for (size_t i = begin; i < end; i += lanes) {
    ProjectVector(splats.block(block) + (i - begin), i, std::min(lanes, end - i), camera, settings,
                  out);
  }
}

// dL/d(unit quaternion) from dL/d(rotation matrix) `g`, then through the normalisation.
HWY_INLINE void QuatVjp(const Lanes& o, const V* g, V* out) {
  const D d;
  const V w = o.qw, x = o.qx, y = o.qy, z = o.qz, two = hn::Set(d, 2.0f);
  const V a = hn::Sub(g[7], g[5]), b = hn::Sub(g[2], g[6]), c = hn::Sub(g[3], g[1]);
  const V e = hn::Add(g[1], g[3]), f = hn::Add(g[2], g[6]), h = hn::Add(g[5], g[7]);
  V v[4];
  v[0] = hn::Mul(two, hn::MulAdd(x, a, hn::MulAdd(y, b, hn::Mul(z, c))));
  v[1] = hn::Mul(
      two, hn::MulAdd(
               w, a,
               hn::MulAdd(
                   y, e,
                   hn::MulAdd(z, f, hn::Mul(hn::Mul(hn::Set(d, -2.0f), x), hn::Add(g[4], g[8]))))));
  v[2] = hn::Mul(
      two, hn::MulAdd(
               w, b,
               hn::MulAdd(
                   x, e,
                   hn::MulAdd(z, h, hn::Mul(hn::Mul(hn::Set(d, -2.0f), y), hn::Add(g[0], g[8]))))));
  v[3] = hn::Mul(
      two, hn::MulAdd(
               w, c,
               hn::MulAdd(
                   x, f,
                   hn::MulAdd(y, h, hn::Mul(hn::Mul(hn::Set(d, -2.0f), z), hn::Add(g[0], g[4]))))));
  const V along = hn::MulAdd(v[0], w, hn::MulAdd(v[1], x, hn::MulAdd(v[2], y, hn::Mul(v[3], z))));
  out[0] = hn::Mul(o.inv_qnorm, hn::NegMulAdd(along, w, v[0]));
  out[1] = hn::Mul(o.inv_qnorm, hn::NegMulAdd(along, x, v[1]));
  out[2] = hn::Mul(o.inv_qnorm, hn::NegMulAdd(along, y, v[2]));
  out[3] = hn::Mul(o.inv_qnorm, hn::NegMulAdd(along, z, v[3]));
}

// dL/d(2D covariance), as the full symmetric matrix [a, b; b, c], from the moments of g.
// With X the conic: V = dL/dX = [-Sxx/2, -Sxy/2; ., -Syy/2] and dL/dCov = -X V X.
HWY_INLINE void CovarianceVjp(V A, V B, V C, V sxx, V sxy, V syy, V* a, V* b, V* c) {
  const D d;
  const V half = hn::Set(d, 0.5f);
  // W = (X S) with S the moment matrix, then X S X / 2.
  const V w00 = hn::MulAdd(A, sxx, hn::Mul(B, sxy)), w01 = hn::MulAdd(A, sxy, hn::Mul(B, syy));
  const V w10 = hn::MulAdd(B, sxx, hn::Mul(C, sxy)), w11 = hn::MulAdd(B, sxy, hn::Mul(C, syy));
  *a = hn::Mul(half, hn::MulAdd(w00, A, hn::Mul(w01, B)));
  *b = hn::Mul(half, hn::MulAdd(w00, B, hn::Mul(w01, C)));
  *c = hn::Mul(half, hn::MulAdd(w10, B, hn::Mul(w11, C)));
}

void VjpVector(const float* in, const KernelCamera& cam, const ProjectionSettings& settings,
               const float* sums, M visible, float* grads, float* mean2d_grad) {
  const D d;
  const auto sum = [&](int field) HWY_ATTR { return hn::Load(d, sums + field * kSplatBlock); };
  const auto put = [&](int row, V value) HWY_ATTR {
    hn::Store(hn::IfThenElseZero(visible, value), d, grads + row * kSplatBlock);
  };
  const V3 mean = LoadMean(in);
  const V3 p = ToCamera(mean, cam);
  const Lanes o = ProjectLanes(in, p, cam);
  const V inv_det = hn::Div(hn::Set(d, 1.0f), o.det);
  const V A = hn::Mul(o.cov_c, inv_det), B = hn::Neg(hn::Mul(o.cov_b, inv_det)),
          C = hn::Mul(o.cov_a, inv_det);

  // Screen-space mean: d ln(alpha) / d mean2d = X d.
  const V sx = sum(kGradX), sy = sum(kGradY);
  const V v_mx = hn::MulAdd(A, sx, hn::Mul(B, sy)), v_my = hn::MulAdd(B, sx, hn::Mul(C, sy));
  hn::Store(hn::IfThenElseZero(visible, v_mx), d, mean2d_grad);
  hn::Store(hn::IfThenElseZero(visible, v_my), d, mean2d_grad + kSplatBlock);

  // Opacity: d ln sigmoid(x) = sigmoid(-x).
  const V logit = hn::Load(d, in + kLogitOpacity * kSplatBlock);
  put(kLogitOpacity, hn::Mul(sum(kGradSum), hn::Exp(d, LogSigmoid(hn::Neg(logit)))));

  // Covariance: Cov = T T^T + eps I.
  V g00, g01, g11;
  CovarianceVjp(A, B, C, sum(kGradXX), sum(kGradXY), sum(kGradYY), &g00, &g01, &g11);
  const V two = hn::Set(d, 2.0f);
  const V3 v_t0 = Scale(Axpy(g01, o.T1, Scale(o.T0, g00)), two);
  const V3 v_t1 = Scale(Axpy(g01, o.T0, Scale(o.T1, g11)), two);

  // T0 = s0 (U0 - u U2), T1 = s1 (U1 - v U2); s = f / Z; u = X/Z, v = Y/Z unless limited.
  const V3 v_u0 = Scale(v_t0, o.s0), v_u1 = Scale(v_t1, o.s1);
  const V3 v_u2 = Axpy(hn::Neg(o.v), v_u1, Scale(v_u0, hn::Neg(o.u)));
  const V fx = hn::Set(d, cam.fx), fy = hn::Set(d, cam.fy);
  const V v_u = hn::MulAdd(fx, v_mx, hn::IfThenElseZero(o.u_free, hn::Neg(Dot(v_u0, o.U2))));
  const V v_v = hn::MulAdd(fy, v_my, hn::IfThenElseZero(o.v_free, hn::Neg(Dot(v_u1, o.U2))));
  // mean2d depends on the unlimited X/Z; where the limit acts only that path is left.
  const V ratio_x = hn::Mul(p.x, o.inv_z), ratio_y = hn::Mul(p.y, o.inv_z);
  const V v_ln_z = hn::Add(hn::MulAdd(v_u, ratio_x, hn::Mul(v_v, ratio_y)),
                           hn::Add(Dot(v_t0, o.T0), Dot(v_t1, o.T1)));
  V v_pz = hn::Neg(hn::Mul(v_ln_z, o.inv_z));
  if (settings.channels == kNumChannels) {
    const V v_depth = sum(kGradFeatures + kChannelDepth);
    if (settings.depth_is_camera_z) {
      v_pz = hn::Add(v_pz, v_depth);
      put(kDepth, hn::Zero(d));
    } else {
      put(kDepth, v_depth);
    }
    for (int r = kStructure; r < kIllumination + 3; ++r) {
      put(r, sum(kGradFeatures + kChannelStructure + (r - kStructure)));
    }
  }
  const V3 v_p = {hn::Mul(v_u, o.inv_z), hn::Mul(v_v, o.inv_z), v_pz};

  // Back to the world: mean, then R S.
  const auto column = [&](int j, const V3& r) HWY_ATTR {
    return hn::MulAdd(
        hn::Set(d, cam.R[j]), r.x,
        hn::MulAdd(hn::Set(d, cam.R[3 + j]), r.y, hn::Mul(hn::Set(d, cam.R[6 + j]), r.z)));
  };
  V3 v_mean = {column(0, v_p), column(1, v_p), column(2, v_p)};

  V v_rot[9], v_scale[3];
  const V* scale = &o.scale.x;
  for (int j = 0; j < 3; ++j) {
    const V3 r = {(&v_u0.x)[j], (&v_u1.x)[j], (&v_u2.x)[j]};
    v_scale[j] = hn::Zero(d);
    for (int i = 0; i < 3; ++i) {
      const V v_m = column(i, r);
      v_scale[j] = hn::MulAdd(v_m, o.rot[3 * i + j], v_scale[j]);
      v_rot[3 * i + j] = hn::Mul(v_m, scale[j]);
    }
    put(kLogScale + j, hn::Mul(v_scale[j], scale[j]));
  }
  V v_quat[4];
  QuatVjp(o, v_rot, v_quat);
  for (int j = 0; j < 4; ++j) put(kRawQuat + j, v_quat[j]);

  // Colour, and its dependence on the viewing direction.
  V inv_distance;
  const V3 dir = Direction(mean, cam, &inv_distance);
  V v_color[3];
  for (int c = 0; c < 3; ++c) {
    v_color[c] = hn::IfThenElseZero(visible, sum(kGradFeatures + kChannelColor + c));
  }
  V v_dir[3];
  ShEvalVjp(d, settings.sh_degree, dir.x, dir.y, dir.z, in, v_color, grads, v_dir);
  const V3 vd = {v_dir[0], v_dir[1], v_dir[2]};
  const V3 tangential = Axpy(hn::Neg(Dot(dir, vd)), dir, vd);
  v_mean = Axpy(inv_distance, tangential, v_mean);
  put(kMean, v_mean.x);
  put(kMean + 1, v_mean.y);
  put(kMean + 2, v_mean.z);
}

void ProjectBlockVjpImpl(const Splats& splats, size_t block, const KernelCamera& camera,
                         const ProjectionSettings& settings, const float* sums, uint32_t visible,
                         float* grads, float* mean2d_grad) {
  const D d;
  const hn::RebindToSigned<D> di;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN int32_t bits[kSplatBlock];
  for (int i = 0; i < kSplatBlock; ++i) bits[i] = -static_cast<int32_t>((visible >> i) & 1);
  for (size_t i = 0; i < kSplatBlock; i += lanes) {
    const M mask = hn::RebindMask(d, hn::MaskFromVec(hn::Load(di, bits + i)));
    VjpVector(splats.block(block) + i, camera, settings, sums + i, mask, grads + i,
              mean2d_grad + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(ProjectBlockImpl);
HWY_EXPORT(ProjectBlockVjpImpl);

KernelCamera::KernelCamera(const Camera& camera)
    : width(camera.width),
      height(camera.height),
      fx(camera.fx),
      fy(camera.fy),
      cx(camera.cx),
      cy(camera.cy) {
  const auto c = camera.Center();
  for (int i = 0; i < 9; ++i) R[i] = static_cast<float>(camera.R[i]);
  for (int i = 0; i < 3; ++i) {
    t[i] = static_cast<float>(camera.t[i]);
    center[i] = static_cast<float>(c[i]);
  }
  min_u = -(cx / fx + kJacobianMargin * width / fx);
  max_u = (width - cx) / fx + kJacobianMargin * width / fx;
  min_v = -(cy / fy + kJacobianMargin * height / fy);
  max_v = (height - cy) / fy + kJacobianMargin * height / fy;
}

void ProjectedSplats::Resize(size_t n, int new_channels) {
  channels = new_channels;
  records.resize(n * RecordStride(channels));
  depths.resize(n);
  boxes.resize(n);
  spans.resize(n);
}

void ProjectBlock(const Splats& splats, size_t block, const KernelCamera& camera,
                  const ProjectionSettings& settings, ProjectedSplats* out) {
  HWY_DYNAMIC_DISPATCH(ProjectBlockImpl)(splats, block, camera, settings, out);
}

void ProjectBlockVjp(const Splats& splats, size_t block, const KernelCamera& camera,
                     const ProjectionSettings& settings, const float* sums, uint32_t visible,
                     float* grads, float* mean2d_grad) {
  HWY_DYNAMIC_DISPATCH(ProjectBlockVjpImpl)
  (splats, block, camera, settings, sums, visible, grads, mean2d_grad);
}

}  // namespace litags
#endif  // HWY_ONCE
