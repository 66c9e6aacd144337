#include "engine/render/projection.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/projection.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"
// After highway.h: these define per-target code.
#include "engine/render/ellipse-inl.h"
#include "engine/render/projection-inl.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr float kLog2E = 1.44269504f;

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

// One vector of projected Gaussians, field by field.
struct Rows {
  HWY_ALIGN float record[RecordStride(kNumChannels)][kSplatBlock];
  HWY_ALIGN float depth[kSplatBlock], seen[kSplatBlock];
  // Gaussian by Gaussian, in the order of Box and Spans.
  HWY_ALIGN int32_t box[kSplatBlock][4], spans[kSplatBlock][4];
};

// Four rows of whole numbers, Gaussian by Gaussian.
HWY_INLINE void StoreWhole(V a, V b, V c, V e, int32_t (*out)[4]) {
  const hn::RebindToSigned<D> d;
  hn::StoreInterleaved4(hn::ConvertTo(d, a), hn::ConvertTo(d, b), hn::ConvertTo(d, c),
                        hn::ConvertTo(d, e), d, out[0]);
}

// Z given the pixel is linear in it, by the covariance of both: conic cov(mean2d, Z).
HWY_INLINE void StoreDepth(const Lanes& o, V inv_det, Rows* rows) {
  const D d;
  const V cx = Dot(o.T0, o.U2), cy = Dot(o.T1, o.U2);
  const V dx = hn::MulSub(o.cov_c, cx, hn::Mul(o.cov_b, cy));
  const V dy = hn::MulSub(o.cov_a, cy, hn::Mul(o.cov_b, cx));
  hn::Store(o.p.z, d, rows->record[kRecordFeatures]);
  hn::Store(hn::Mul(dx, inv_det), d, rows->record[kRecordDzDx]);
  hn::Store(hn::Mul(dy, inv_det), d, rows->record[kRecordDzDy]);
}

// Channels of the record.
HWY_INLINE void StoreFeatures(const float* in, const V3& mean, V z, const KernelCamera& cam,
                              const RenderSettings& settings, Rows* rows) {
  const D d;
  const auto copy = [&](int row, int channel) HWY_ATTR {
    hn::Store(hn::Load(d, in + row * kSplatBlock), d, rows->record[kRecordFeatures + channel]);
  };
  V inv_distance;
  const V3 dir = Direction(mean, cam, &inv_distance);
  V color[3];
  ShEval(d, settings.sh_degree, dir.x, dir.y, dir.z, in, color);
  if (settings.lamp.power > 0) {
    const V gain = LampGain(settings.lamp, inv_distance);
    for (int c = 0; c < 3; ++c) color[c] = hn::Mul(color[c], gain);
  }
  for (int c = 0; c < 3; ++c) hn::Store(color[c], d, rows->record[kRecordFeatures + c]);
  if (settings.num_channels == kColorAndNoise) {
    for (int c = 0; c < 3; ++c) copy(kNoise + c, 3 + c);
  }
  if (settings.num_channels < kWithoutNoise) return;
  copy(kDepth, kChannelDepth);
  if (settings.depth_source == DepthSource::kCameraZ) {
    hn::Store(z, d, rows->record[kRecordFeatures + kChannelDepth]);
  }
  copy(kStructure, kChannelStructure);
  for (int c = 0; c < 3; ++c) copy(kIllumination + c, kChannelIllumination + c);
  if (settings.num_channels < kNumChannels) return;
  for (int c = 0; c < 3; ++c) copy(kNoise + c, kChannelNoise + c);
}

// Tiles that the ellipse reaches in the box's first rows of tiles.
HWY_INLINE void StoreSpans(const Ellipse<V>& ellipse, V x0, V x1, V y0, V y1, Rows* rows) {
  const D d;
  const V tile = hn::Set(d, static_cast<float>(kTileSize));
  const auto tile_of = [&](V px) HWY_ATTR { return hn::Floor(hn::Div(px, tile)); };
  V firsts[ProjectedSplats::kSpanRows], lasts[ProjectedSplats::kSpanRows];
  for (int row = 0; row < ProjectedSplats::kSpanRows; ++row) {
    const V top = hn::Mul(hn::Add(tile_of(y0), hn::Set(d, static_cast<float>(row))), tile);
    const Columns<V> columns =
        ColumnsOfRows(d, ellipse, top, hn::Add(top, hn::Set(d, kTileSize - 1.0f)), 0.0f);
    // Numbers that are not finite give all of the box.
    const V first = hn::IfThenElse(hn::Ge(columns.first, x0), columns.first, x0);
    const V last = hn::IfThenElse(hn::Le(columns.last, x1), columns.last, x1);
    const M some = hn::And(hn::Le(first, last), hn::Le(top, y1));
    firsts[row] = hn::IfThenElseZero(some, tile_of(first));
    lasts[row] = hn::IfThenElse(some, tile_of(last), hn::Set(d, -1.0f));
  }
  StoreWhole(firsts[0], firsts[1], lasts[0], lasts[1], rows->spans);
}

// Rows to Gaussians `begin` to `begin + count`. Returns how many are visible.
size_t Scatter(const Rows& rows, size_t begin, size_t count, ProjectedSplats* out) {
  const D d;
  const hn::FixedTag<float, 4> quad;
  const hn::FixedTag<int32_t, 4> di;
  const hn::FixedTag<int16_t, 4> di16;
  const int stride = RecordStride(out->channels);
  HWY_ALIGN float fields[RecordStride(kNumChannels) / 4][kSplatBlock][4];
  for (int f = 0; f < stride; f += 4) {
    const auto row = [&](int i) HWY_ATTR { return hn::Load(d, rows.record[f + i]); };
    hn::StoreInterleaved4(row(0), row(1), row(2), row(3), d, fields[f / 4][0]);
  }
  const auto narrow = [&](const int32_t* from, auto* to) HWY_ATTR {
    static_assert(sizeof(*to) == 4 * sizeof(int16_t));
    hn::StoreU(hn::DemoteTo(di16, hn::Load(di, from)), di16, reinterpret_cast<int16_t*>(to));
  };
  size_t visible = 0;
  for (size_t i = 0; i < count; ++i) {
    out->boxes[begin + i] = {};
    if (rows.seen[i] == 0.0f) continue;
    ++visible;
    narrow(rows.box[i], &out->boxes[begin + i]);
    narrow(rows.spans[i], &out->spans[begin + i]);
    out->depths[begin + i] = rows.depth[i];
    float* record = out->records.data() + (begin + i) * stride;
    for (int f = 0; f < stride; f += 4) {
      hn::Store(hn::Load(quad, fields[f / 4][i]), quad, record + f);
    }
  }
  return visible;
}

// What a Dropout does to one vector.
struct Dropped {
  M left_out;
  V log2_gain;  // of the others' opacity
  V reach;      // standard deviations at which no opacity leaves an alpha of 1/255
};

// Whether no Gaussian in front reaches a pixel, whichever way its longest axis lies. Of those of a
// crop that are elsewhere nothing else is looked at: half a width is at most `reach` times
// sqrt((f / Z)^2 (1 + u^2) scale^2 + eps).
HWY_INLINE bool AllOutOfSight(const float* in, const V3& p, M in_front, const KernelCamera& cam,
                              PixelFilter filter, V reach) {
  const D d;
  // Everything times Z.
  const V x = hn::MulAdd(hn::Set(d, cam.fx), p.x, hn::Mul(hn::Set(d, cam.cx), p.z));
  const V y = hn::MulAdd(hn::Set(d, cam.fy), p.y, hn::Mul(hn::Set(d, cam.cy), p.z));
  const V width = hn::Mul(hn::Set(d, cam.width), p.z),
          height = hn::Mul(hn::Set(d, cam.height), p.z);
  const auto within = [&](V at, V size, V half) HWY_ATTR {
    return hn::And(hn::Ge(hn::Add(at, half), hn::Zero(d)), hn::Le(hn::Sub(at, half), size));
  };
  const V none = hn::Zero(d);
  const M centers = hn::And(within(x, width, none), within(y, height, none));
  if (!hn::AllFalse(d, hn::And(in_front, centers))) return false;

  const auto load = [&](int row) HWY_ATTR { return hn::Load(d, in + row * kSplatBlock); };
  const V longest =
      hn::Exp(d, hn::Max(load(kLogScale), hn::Max(load(kLogScale + 1), load(kLogScale + 2))));
  const V radius = hn::Mul(reach, longest);
  const float eps = filter == PixelFilter::kMip ? kMipEps2d : kEps2d;
  const V slack = hn::Mul(hn::MulAdd(reach, hn::Set(d, std::sqrt(eps)), hn::Set(d, 1.0f)), p.z);
  const V half_w = hn::MulAdd(hn::Set(d, cam.spread_x), radius, slack);
  const V half_h = hn::MulAdd(hn::Set(d, cam.spread_y), radius, slack);
  return hn::AllFalse(
      d, hn::And(in_front, hn::And(within(x, width, half_w), within(y, height, half_h))));
}

// The record but its channels, and zeros where they end.
HWY_INLINE void StoreRecord(const Lanes& o, const Ellipse<V>& ellipse, V inv_det, V log2_opacity,
                            int channels, Rows* rows) {
  const D d;
  const auto put = [&](int field, V value) HWY_ATTR { hn::Store(value, d, rows->record[field]); };
  for (int f = kRecordFeatures + channels; f < RecordStride(channels); ++f) put(f, hn::Zero(d));
  const V half_log2e = hn::Set(d, -0.5f * kLog2E);
  put(kRecordX, ellipse.x);
  put(kRecordY, ellipse.y);
  put(kRecordHalfHeight, ellipse.half_height);
  put(kRecordShear, ellipse.shear);
  put(kRecordAspect, ellipse.aspect);
  put(kRecordDyRight, ellipse.dy_right);
  put(kRecordA, hn::Mul(half_log2e, hn::Mul(o.cov_c, inv_det)));
  put(kRecordB, hn::Mul(hn::Set(d, kLog2E), hn::Mul(o.cov_b, inv_det)));
  put(kRecordC, hn::Mul(half_log2e, hn::Mul(o.cov_a, inv_det)));
  put(kRecordLog2Opacity, log2_opacity);
}

// Projects one vector of Gaussians, `begin` to `begin + count`; `in` points at its first lane.
// Returns how many are visible.
size_t ProjectVector(const float* in, size_t begin, size_t count, const KernelCamera& cam,
                     const RenderSettings& settings, const Dropped& dropped, ProjectedSplats* out) {
  const D d;
  const V3 mean = LoadMean(in);
  const V3 p = ToCamera(mean, cam);
  const M in_front = hn::AndNot(dropped.left_out, hn::Gt(p.z, hn::Set(d, settings.near_plane)));
  const auto clear = [&]() {
    std::fill_n(out->boxes.begin() + begin, count, ProjectedSplats::Box());
    return size_t{0};
  };
  if (hn::AllFalse(d, in_front)) return clear();
  if (AllOutOfSight(in, p, in_front, cam, settings.pixel_filter, dropped.reach)) return clear();

  const Lanes o = ProjectLanes(in, p, cam, settings.pixel_filter);
  const V logit = hn::Load(d, in + kLogitOpacity * kSplatBlock);
  V log2_opacity = hn::MulAdd(hn::Set(d, kLog2E), LogSigmoid(logit), dropped.log2_gain);
  if (settings.pixel_filter == PixelFilter::kMip) {
    log2_opacity = hn::MulAdd(hn::Set(d, 0.5f), hn::Log2(d, AreaRatio(o)), log2_opacity);
  }
  // alpha >= 1/255 inside d^T conic d <= q.
  const V q = hn::Mul(hn::Set(d, 2.0f / kLog2E), hn::Sub(log2_opacity, hn::Set(d, kLog2AlphaMin)));
  // A little wider than exact: rounding must not lose a pixel at the rim.
  const V q_wide = hn::MulAdd(q, hn::Set(d, 1e-4f), hn::Add(q, hn::Set(d, 1e-4f)));
  const V half_w = hn::Sqrt(hn::Mul(q_wide, o.cov_a)), half_h = hn::Sqrt(hn::Mul(q_wide, o.cov_c));
  const V x = hn::MulAdd(hn::Mul(p.x, o.inv_z), hn::Set(d, cam.fx), hn::Set(d, cam.cx));
  const V y = hn::MulAdd(hn::Mul(p.y, o.inv_z), hn::Set(d, cam.fy), hn::Set(d, cam.cy));
  V x0, x1, y0, y1;
  PixelRange(x, half_w, cam.width, &x0, &x1);
  PixelRange(y, half_h, cam.height, &y0, &y1);
  const M opaque = hn::And(hn::Gt(q, hn::Zero(d)), hn::Eq(logit, logit));  // LogSigmoid(NaN) is 0
  const M visible = hn::And(hn::And(in_front, opaque), hn::And(hn::Le(x0, x1), hn::Le(y0, y1)));
  if (hn::AllFalse(d, visible)) return clear();

  Rows rows;
  const V inv_det = hn::Div(hn::Set(d, 1.0f), o.det);
  const Ellipse<V> ellipse = {x,
                              y,
                              half_h,
                              hn::Div(o.cov_b, o.cov_c),
                              hn::Div(hn::Sqrt(o.det), o.cov_c),
                              hn::Mul(o.cov_b, hn::Sqrt(hn::Div(q_wide, o.cov_a)))};
  StoreRecord(o, ellipse, inv_det, log2_opacity, settings.num_channels, &rows);
  if (settings.num_channels == kDepthOnly) {
    StoreDepth(o, inv_det, &rows);
  } else {
    StoreFeatures(in, mean, p.z, cam, settings, &rows);
  }
  StoreSpans(ellipse, x0, x1, y0, y1, &rows);
  hn::Store(p.z, d, rows.depth);
  StoreWhole(x0, x1, y0, y1, rows.box);
  hn::Store(hn::IfThenElseZero(visible, hn::Set(d, 1.0f)), d, rows.seen);
  return Scatter(rows, begin, count, out);
}

void ProjectBlockImpl(const Splats& splats, size_t block, const KernelCamera& camera,
                      const RenderSettings& settings, ProjectedSplats* out) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const size_t begin = block * kSplatBlock, end = std::min(splats.size(), begin + kSplatBlock);
  const uint32_t left_out = settings.dropout.LeftOut(block);
  const auto log2_gain = static_cast<float>(-std::log2(1 - settings.dropout.share));
  // alpha = opacity exp(-r^2 / 2). A little wider, for rounding.
  const float reach = 1.001f * std::sqrt(2 / kLog2E * (log2_gain - kLog2AlphaMin));
  size_t visible = 0;
  for (size_t i = begin; i < end; i += lanes) {
    const uint64_t bits = left_out >> (i - begin);
    const Dropped dropped = {hn::LoadMaskBits(d, reinterpret_cast<const uint8_t*>(&bits)),
                             hn::Set(d, log2_gain), hn::Set(d, reach)};
    visible += ProjectVector(splats.block(block) + (i - begin), i, std::min(lanes, end - i), camera,
                             settings, dropped, out);
  }
  out->visible[block] = static_cast<uint8_t>(visible);
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(ProjectBlockImpl);

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
  spread_x = fx * std::hypot(1.0f, std::max(-min_u, max_u));
  spread_y = fy * std::hypot(1.0f, std::max(-min_v, max_v));
}

void KernelCamera::CropTo(const PixelRect& crop) {
  width = crop.width;
  height = crop.height;
  cx -= crop.x;
  cy -= crop.y;
}

void ProjectedSplats::Resize(size_t n, int new_channels) {
  channels = new_channels;
  ResizeScratch(n * RecordStride(channels), &records);
  depths.resize(n);
  boxes.resize(n);
  spans.resize(n);
  visible.resize((n + kSplatBlock - 1) / kSplatBlock);
}

void ProjectBlock(const Splats& splats, size_t block, const KernelCamera& camera,
                  const RenderSettings& settings, ProjectedSplats* out) {
  HWY_DYNAMIC_DISPATCH(ProjectBlockImpl)(splats, block, camera, settings, out);
}

}  // namespace litags
#endif  // HWY_ONCE
