#include "engine/render/projection.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/projection_vjp.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"
// After highway.h: these define per-target code.
#include "engine/render/projection-inl.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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

// Component `axis` of a camera-space vector in the world: R^T v.
HWY_INLINE V ToWorld(int axis, const V3& v, const KernelCamera& cam) {
  const D d;
  const auto r = [&](int row) HWY_ATTR { return hn::Set(d, cam.R[3 * row + axis]); };
  return hn::MulAdd(r(0), v.x, hn::MulAdd(r(1), v.y, hn::Mul(r(2), v.z)));
}

// Component `row` of a world vector in the camera's axes: R v.
HWY_INLINE V ToCameraAxes(int row, const V3& v, const KernelCamera& cam) {
  const D d;
  const auto r = [&](int axis) HWY_ATTR { return hn::Set(d, cam.R[3 * row + axis]); };
  return hn::MulAdd(r(0), v.x, hn::MulAdd(r(1), v.y, hn::Mul(r(2), v.z)));
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

// Adds what comes by way of the opacity's factor r of PixelFilter::kMip. With S = dL/d(ln r) and
// Cov = T T^T: dL/dCov = S / 2 (Cov^-1 - X) = S / 2 eps Cov^-1 X, which is no difference of near
// equals.
HWY_INLINE void MipFilterVjp(const Lanes& o, V A, V B, V C, V s, V* a, V* b, V* c) {
  const D d;
  const V scale =
      hn::Div(hn::Mul(hn::Mul(hn::Set(d, 0.5f), s), o.eps), hn::Mul(AreaRatio(o), o.det));
  *a = hn::MulAdd(scale, hn::MulSub(o.sharp_c, A, hn::Mul(o.cov_b, B)), *a);
  *b = hn::MulAdd(scale, hn::MulSub(o.sharp_c, B, hn::Mul(o.cov_b, C)), *b);
  *c = hn::MulAdd(scale, hn::MulSub(o.sharp_a, C, hn::Mul(o.cov_b, B)), *c);
}

// What a vector of Gaussians' VJP reads and writes.
struct VjpRows {
  const float* in;    // parameters
  const float* sums;  // pixel sums
  M visible;
  float* grads;

  HWY_INLINE V Sum(int field) const { return hn::Load(D(), sums + field * kSplatBlock); }
  HWY_INLINE void Put(int row, V value) const {
    hn::Store(hn::IfThenElseZero(visible, value), D(), grads + row * kSplatBlock);
  }
};

// Depth (also by way of the camera's Z: returns dL/dZ) and the attributes that are composited as
// they are.
HWY_INLINE V AttributesVjp(const VjpRows& rows, const RenderSettings& settings) {
  const D d;
  if (settings.num_channels < kWithoutNoise) return hn::Zero(d);
  const auto copy = [&](int channel, int row)
                        HWY_ATTR { rows.Put(row, rows.Sum(kGradFeatures + channel)); };
  copy(kChannelStructure, kStructure);
  for (int c = 0; c < 3; ++c) {
    copy(kChannelIllumination + c, kIllumination + c);
    if (settings.num_channels == kNumChannels) copy(kChannelNoise + c, kNoise + c);
  }
  const V v_depth = rows.Sum(kGradFeatures + kChannelDepth);
  const bool camera_z = settings.depth_source == DepthSource::kCameraZ;
  rows.Put(kDepth, camera_z ? hn::Zero(d) : v_depth);
  return camera_z ? v_depth : hn::Zero(d);
}

// SH coefficients; returns dL/dmean by way of the viewing direction, and of the distance from a
// lamp.
HWY_INLINE V3 ColorVjp(const VjpRows& rows, const V3& mean, const KernelCamera& cam,
                       const RenderSettings& settings) {
  const D d;
  V inv_distance;
  const V3 dir = Direction(mean, cam, &inv_distance);
  V v_color[3];
  for (int c = 0; c < 3; ++c) {
    v_color[c] = hn::IfThenElseZero(rows.visible, rows.Sum(kGradFeatures + kChannelColor + c));
  }
  V along = hn::Zero(d);  // dL/d(ln distance), by the lamp
  if (settings.lamp.power > 0) {
    const V gain = LampGain(settings.lamp, inv_distance);
    V color[3];
    ShEval(d, settings.sh_degree, dir.x, dir.y, dir.z, rows.in, color);
    for (int c = 0; c < 3; ++c) {
      v_color[c] = hn::Mul(v_color[c], gain);
      along = hn::NegMulAdd(hn::Mul(v_color[c], color[c]), hn::Set(d, settings.lamp.power), along);
    }
  }
  V v_dir[3];
  ShEvalVjp(d, settings.sh_degree, dir.x, dir.y, dir.z, rows.in, v_color, rows.grads, v_dir);
  const V3 vd = {v_dir[0], v_dir[1], v_dir[2]};
  return Scale(Axpy(hn::Sub(along, Dot(dir, vd)), dir, vd), inv_distance);
}

// Scale and rotation from dL/dU, U = W R S, given by its rows.
HWY_INLINE void ShapeVjp(const VjpRows& rows, const Lanes& o, const KernelCamera& cam,
                         const V3 (&v_u)[3]) {
  const D d;
  V v_rot[9];
  const V* scale = &o.scale.x;
  for (int j = 0; j < 3; ++j) {
    const V3 r = {(&v_u[0].x)[j], (&v_u[1].x)[j], (&v_u[2].x)[j]};
    V v_scale = hn::Zero(d);
    for (int i = 0; i < 3; ++i) {
      const V v_m = ToWorld(i, r, cam);
      v_scale = hn::MulAdd(v_m, o.rot[3 * i + j], v_scale);
      v_rot[3 * i + j] = hn::Mul(v_m, scale[j]);
    }
    rows.Put(kLogScale + j, hn::Mul(v_scale, scale[j]));
  }
  V v_quat[4];
  QuatVjp(o, v_rot, v_quat);
  for (int j = 0; j < 4; ++j) rows.Put(kRawQuat + j, v_quat[j]);
}

// Adds a vector of Gaussians' part of dL/dpose. A turn of the camera about its centre leaves the
// directions of view as they are; a shift by v changes them as one of the mean by R^T v does.
HWY_INLINE void AddPoseVjp(const VjpRows& rows, const Lanes& o, const V3& v_p, const V3 (&v_u)[3],
                           const V3& by_color, const KernelCamera& cam, PoseVector* pose_grad) {
  const D d;
  // p x v_p, and the same of the columns of U.
  const auto cross = [](V a, V v_b, V b, V v_a)
                         HWY_ATTR { return hn::MulSub(a, v_b, hn::Mul(b, v_a)); };
  const V parts[6] = {
      hn::Add(cross(o.p.y, v_p.z, o.p.z, v_p.y), hn::Sub(Dot(o.U1, v_u[2]), Dot(o.U2, v_u[1]))),
      hn::Add(cross(o.p.z, v_p.x, o.p.x, v_p.z), hn::Sub(Dot(o.U2, v_u[0]), Dot(o.U0, v_u[2]))),
      hn::Add(cross(o.p.x, v_p.y, o.p.y, v_p.x), hn::Sub(Dot(o.U0, v_u[1]), Dot(o.U1, v_u[0]))),
      hn::Add(v_p.x, ToCameraAxes(0, by_color, cam)),
      hn::Add(v_p.y, ToCameraAxes(1, by_color, cam)),
      hn::Add(v_p.z, ToCameraAxes(2, by_color, cam))};
  for (int k = 0; k < 6; ++k) {
    (*pose_grad)[k] += hn::GetLane(hn::SumOfLanes(d, hn::IfThenElseZero(rows.visible, parts[k])));
  }
}

void VjpVector(const VjpRows& rows, const KernelCamera& cam, const RenderSettings& settings,
               float* mean2d_grad, PoseVector* pose_grad) {
  const D d;
  const V3 mean = LoadMean(rows.in);
  const V3 p = ToCamera(mean, cam);
  const Lanes o = ProjectLanes(rows.in, p, cam, settings.pixel_filter);
  const V inv_det = hn::Div(hn::Set(d, 1.0f), o.det);
  const V A = hn::Mul(o.cov_c, inv_det), B = hn::Neg(hn::Mul(o.cov_b, inv_det)),
          C = hn::Mul(o.cov_a, inv_det);

  // Screen-space mean: d ln(alpha) / d mean2d = X d.
  const V sx = rows.Sum(kGradX), sy = rows.Sum(kGradY);
  const V v_mx = hn::MulAdd(A, sx, hn::Mul(B, sy)), v_my = hn::MulAdd(B, sx, hn::Mul(C, sy));
  hn::Store(hn::IfThenElseZero(rows.visible, v_mx), d, mean2d_grad);
  hn::Store(hn::IfThenElseZero(rows.visible, v_my), d, mean2d_grad + kSplatBlock);

  // Opacity: d ln sigmoid(x) = sigmoid(-x).
  const V logit = hn::Load(d, rows.in + kLogitOpacity * kSplatBlock);
  rows.Put(kLogitOpacity, hn::Mul(rows.Sum(kGradSum), hn::Exp(d, LogSigmoid(hn::Neg(logit)))));

  // Covariance: Cov = T T^T + eps I.
  V g00, g01, g11;
  CovarianceVjp(A, B, C, rows.Sum(kGradXX), rows.Sum(kGradXY), rows.Sum(kGradYY), &g00, &g01, &g11);
  if (settings.pixel_filter == PixelFilter::kMip) {
    MipFilterVjp(o, A, B, C, rows.Sum(kGradSum), &g00, &g01, &g11);
  }
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
  const V v_pz = hn::Sub(AttributesVjp(rows, settings), hn::Mul(v_ln_z, o.inv_z));

  const V3 v_p = {hn::Mul(v_u, o.inv_z), hn::Mul(v_v, o.inv_z), v_pz};
  const V3 v_rows[3] = {v_u0, v_u1, v_u2};
  ShapeVjp(rows, o, cam, v_rows);
  const V3 by_color = ColorVjp(rows, mean, cam, settings);
  if (pose_grad != nullptr) AddPoseVjp(rows, o, v_p, v_rows, by_color, cam, pose_grad);
  rows.Put(kMean, hn::Add(ToWorld(0, v_p, cam), by_color.x));
  rows.Put(kMean + 1, hn::Add(ToWorld(1, v_p, cam), by_color.y));
  rows.Put(kMean + 2, hn::Add(ToWorld(2, v_p, cam), by_color.z));
}

void ProjectBlockVjpImpl(const Splats& splats, size_t block, const KernelCamera& camera,
                         const RenderSettings& settings, const float* sums, uint32_t visible,
                         float* grads, float* mean2d_grad, PoseVector* pose_grad) {
  const D d;
  const hn::RebindToSigned<D> di;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN int32_t bits[kSplatBlock];
  for (int i = 0; i < kSplatBlock; ++i) bits[i] = -static_cast<int32_t>((visible >> i) & 1);
  for (size_t i = 0; i < kSplatBlock; i += lanes) {
    const M mask = hn::RebindMask(d, hn::MaskFromVec(hn::Load(di, bits + i)));
    VjpVector({splats.block(block) + i, sums + i, mask, grads + i}, camera, settings,
              mean2d_grad + i, pose_grad);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(ProjectBlockVjpImpl);

void ProjectBlockVjp(const Splats& splats, size_t block, const KernelCamera& camera,
                     const RenderSettings& settings, const float* sums, uint32_t visible,
                     float* grads, float* mean2d_grad, PoseVector* pose_grad) {
  HWY_DYNAMIC_DISPATCH(ProjectBlockVjpImpl)
  (splats, block, camera, settings, sums, visible, grads, mean2d_grad, pose_grad);
}

}  // namespace litags
#endif  // HWY_ONCE
