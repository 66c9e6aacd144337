#include "engine/render/rasterize.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/render/constants.h"
#include "hwy/cache_control.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/rasterize.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

constexpr int kTilePixels = kTileSize * kTileSize;
constexpr int kColumns = kTileSize / kBlockWidth;  // blocks across a tile
constexpr float kLn2 = 0.69314718f;

// How blocks tile the tile for this target's vector length.
struct Layout {
  int lanes, block_height, rows, blocks;
  Layout() {
    lanes = static_cast<int>(hn::Lanes(D()));
    block_height = lanes / kBlockWidth;
    rows = kTileSize / block_height;
    blocks = rows * kColumns;
  }
  uint64_t AllBlocks() const { return blocks == 64 ? ~uint64_t{0} : (uint64_t{1} << blocks) - 1; }
};

// 2^x for x <= 0, to 2.3e-7 relative; anything below 2^-126 gives values below 1/255, which is all
// that callers look at. Degree-5 minimax polynomial on [-1/2, 1/2], fitted for this project.
HWY_INLINE V Exp2(V x) {
  const D d;
  const hn::RebindToSigned<D> di;
  x = hn::Max(x, hn::Set(d, -126.0f));
  const auto n = hn::NearestInt(x);
  const V f = hn::Sub(x, hn::ConvertTo(d, n));
  V p = hn::Set(d, 0.0013276470f);
  p = hn::MulAdd(p, f, hn::Set(d, 0.0096755410f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.0555071309f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.2402212024f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.6931469440f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0000001192f));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(n)));
}

// One Gaussian's coefficients, broadcast.
struct Gaussian {
  V x, y, a, b, c, log2_opacity;
  explicit HWY_INLINE Gaussian(const float* record) {
    const D d;
    x = hn::Set(d, record[kRecordX]);
    y = hn::Set(d, record[kRecordY]);
    a = hn::Set(d, record[kRecordA]);
    b = hn::Set(d, record[kRecordB]);
    c = hn::Set(d, record[kRecordC]);
    log2_opacity = hn::Set(d, record[kRecordLog2Opacity]);
  }
};

// alpha clamped to 0.99, zero below 1/255, at offsets (dx, dy) from the mean.
HWY_INLINE V Alpha(const Gaussian& g, V dx, V dy) {
  const D d;
  const V power = hn::MulAdd(hn::MulAdd(g.a, dx, hn::Mul(g.b, dy)), dx,
                             hn::MulAdd(hn::Mul(g.c, dy), dy, g.log2_opacity));
  const V alpha = Exp2(power);
  return hn::IfThenElseZero(hn::Ge(alpha, hn::Set(d, kAlphaMin)),
                            hn::Min(alpha, hn::Set(d, kAlphaMax)));
}

// Pixel centres of a tile's blocks.
struct PixelGrid {
  V lane_x, lane_y;  // of the first block
  int block_height;
  PixelGrid(const TileJob& job, const Layout& layout) : block_height(layout.block_height) {
    const D d;
    HWY_ALIGN float xs[16], ys[16];
    for (int i = 0; i < layout.lanes; ++i) {
      xs[i] = job.x0 + i % kBlockWidth + 0.5f;
      ys[i] = job.y0 + i / kBlockWidth + 0.5f;
    }
    lane_x = hn::Load(d, xs);
    lane_y = hn::Load(d, ys);
  }
  HWY_INLINE V X(int block) const {
    return hn::Add(lane_x, hn::Set(D(), static_cast<float>(block % kColumns * kBlockWidth)));
  }
  HWY_INLINE V Y(int block) const {
    return hn::Add(lane_y, hn::Set(D(), static_cast<float>(block / kColumns * block_height)));
  }
};

// Blocks that hold a pixel centre inside the ellipse, from the exact x-range of the ellipse over
// each row of blocks.
HWY_INLINE uint64_t BlockMask(const TileJob& job, const Layout& layout, const float* record,
                              const EllipseBounds& e) {
  const hn::CappedTag<float, 8> d;
  const hn::RebindToSigned<decltype(d)> di;
  using W = hn::Vec<decltype(d)>;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  const int step = static_cast<int>(hn::Lanes(d));
  const W hh = set(e.half_height), hh2 = set(e.half_height * e.half_height);
  const W shear = set(e.shear), aspect = set(e.aspect), margin = set(0.02f);
  const W top = set(job.y0 + 0.5f - record[kRecordY]);
  const W base_x = set(record[kRecordX] - job.x0 - 0.5f);
  uint64_t mask = 0;
  for (int row = 0; row < layout.rows; row += step) {
    const W index = hn::Add(hn::Iota(d, 0), set(static_cast<float>(row)));
    const W y = hn::MulAdd(index, set(static_cast<float>(layout.block_height)), top);
    const W lo = hn::Max(y, hn::Neg(hh));
    const W hi = hn::Min(hn::Add(y, set(static_cast<float>(layout.block_height - 1))), hh);
    const W dy_right = hn::Min(hn::Max(set(e.dy_right), lo), hi);
    const W dy_left = hn::Min(hn::Max(set(-e.dy_right), lo), hi);
    const auto half_chord = [&](W dy) HWY_ATTR {
      return hn::Mul(aspect, hn::Sqrt(hn::Max(hn::NegMulAdd(dy, dy, hh2), hn::Zero(d))));
    };
    const W right =
        hn::Add(hn::MulAdd(shear, dy_right, base_x), hn::Add(half_chord(dy_right), margin));
    const W left =
        hn::Sub(hn::MulAdd(shear, dy_left, base_x), hn::Add(half_chord(dy_left), margin));
    // First and one-past-last column of blocks, limited to the tile; empty rows give first >= end.
    const W quarter = set(1.0f / kBlockWidth);
    const W limit = set(static_cast<float>(kColumns));
    const W first =
        hn::Max(hn::Floor(hn::Mul(hn::Ceil(hn::Max(left, set(-1.0f))), quarter)), hn::Zero(d));
    const W end = hn::Min(
        hn::Floor(hn::MulAdd(hn::Floor(hn::Min(right, set(100.0f))), quarter, set(1.0f))), limit);
    const auto nonempty = hn::And(hn::Le(lo, hi), hn::Lt(first, end));
    const auto one = hn::Set(di, 1);
    const auto first_bit = hn::Shl(one, hn::ConvertTo(di, hn::Min(first, limit)));
    const auto end_bit = hn::Shl(one, hn::ConvertTo(di, hn::Max(end, hn::Zero(d))));
    const auto bits = hn::IfThenElseZero(hn::RebindMask(di, nonempty), hn::Sub(end_bit, first_bit));
    const auto placed = hn::Shl(bits, hn::ShiftLeft<2>(hn::Iota(di, 0)));
    // Rows use separate bits, so the sum is their union.
    const uint32_t sum = static_cast<uint32_t>(hn::GetLane(hn::SumOfLanes(di, placed)));
    mask |= uint64_t{sum} << (row * kColumns);
  }
  return mask & layout.AllBlocks();
}

// Records are in memory order, lists in depth order: without help every entry starts with a wait
// for memory. Fetches what entry k + kAhead will need.
HWY_INLINE void PrefetchAhead(const TileJob& job, size_t k, int stride) {
  constexpr size_t kAhead = 8;
  if (k + kAhead >= job.count) return;
  const uint32_t index = job.gaussians[k + kAhead];
  const float* record = job.records + size_t{index} * stride;
  hwy::Prefetch(record);
  hwy::Prefetch(record + stride - 1);
  hwy::Prefetch(job.bounds + index);
}

// Transmittance per pixel. A pixel that is opaque, or outside the image, is marked by the sign bit;
// its value is kept.
HWY_INLINE uint64_t InitTransmittance(const TileJob& job, const Layout& layout, float* T) {
  const int lanes = layout.lanes;
  uint64_t alive = 0;
  for (int block = 0; block < layout.blocks; ++block) {
    for (int i = 0; i < lanes; ++i) {
      const int x = job.x0 + block % kColumns * kBlockWidth + i % kBlockWidth;
      const int y = job.y0 + block / kColumns * layout.block_height + i / kBlockWidth;
      const bool inside = x < job.width && y < job.height;
      T[block * lanes + i] = inside ? 1.0f : -1.0f;
      if (inside) alive |= uint64_t{1} << block;
    }
  }
  return alive;
}

// One step of compositing: given alpha, updates T and returns the alpha that counts (zero for
// pixels that are, or now become, opaque).
HWY_INLINE V Advance(V alpha, V* T) {
  const D d;
  const V next = hn::NegMulAdd(alpha, *T, *T);
  const M goes_on = hn::Ge(next, hn::Set(d, kTransmittanceStop));
  *T = hn::IfThenElse(goes_on, next, hn::Neg(hn::Abs(*T)));
  return hn::IfThenElseZero(goes_on, alpha);
}

HWY_INLINE bool AllOpaque(V T) {
  const D d;
  return hn::AllTrue(d, hn::Lt(T, hn::Zero(d)));
}

// Copies between image planes and the tile's blocks, which lie `stride` floats apart; pixels
// outside the image are skipped (reads give zero).
HWY_INLINE void StorePlane(const TileJob& job, const Layout& layout, const float* blocks,
                           int stride, float* plane) {
  for (int block = 0; block < layout.blocks; ++block) {
    const int x = job.x0 + block % kColumns * kBlockWidth;
    const int columns = std::min(kBlockWidth, job.width - x);
    if (columns <= 0) continue;
    for (int r = 0; r < layout.block_height; ++r) {
      const int y = job.y0 + block / kColumns * layout.block_height + r;
      if (y >= job.height) break;
      const float* in = blocks + block * stride + r * kBlockWidth;
      std::copy(in, in + columns, plane + size_t(y) * job.width + x);
    }
  }
}

HWY_INLINE void LoadPlane(const TileJob& job, const Layout& layout, const float* plane, int stride,
                          float* blocks) {
  for (int block = 0; block < layout.blocks; ++block) {
    std::fill_n(blocks + block * stride, layout.lanes, 0.0f);
    const int x = job.x0 + block % kColumns * kBlockWidth;
    const int columns = std::min(kBlockWidth, job.width - x);
    if (columns <= 0) continue;
    for (int r = 0; r < layout.block_height; ++r) {
      const int y = job.y0 + block / kColumns * layout.block_height + r;
      if (y >= job.height) break;
      const float* in = plane + size_t(y) * job.width + x;
      std::copy(in, in + columns, blocks + block * stride + r * kBlockWidth);
    }
  }
}

template <int C>
int64_t Forward(const TileJob& job, float* image, float* alpha_out) {
  const D d;
  const Layout layout;
  const PixelGrid grid(job, layout);
  const int lanes = layout.lanes;
  constexpr int kStride = RecordStride(C);
  HWY_ALIGN float T[kTilePixels];
  // [block][channel][lane]: what one evaluation touches lies together. Whole planes would lie a
  // power of two apart, and stores to one channel would hold up loads of another.
  HWY_ALIGN float acc[C * kTilePixels] = {};
  const int step = C * lanes;
  uint64_t alive = InitTransmittance(job, layout, T);

  int64_t evaluations = 0;
  size_t k = 0;
  for (; k < job.count && alive != 0; ++k) {
    PrefetchAhead(job, k, kStride);
    const uint32_t index = job.gaussians[k];
    const float* record = job.records + size_t{index} * kStride;
    const uint64_t reached = BlockMask(job, layout, record, job.bounds[index]) & alive;
    job.block_masks[k] = reached;
    const Gaussian g(record);
    for (uint64_t rest = reached; rest != 0; rest &= rest - 1) {
      const int block = std::countr_zero(rest);
      float* const t = T + block * lanes;
      V trans = hn::Load(d, t);
      const V before = trans;
      const V a =
          Advance(Alpha(g, hn::Sub(grid.X(block), g.x), hn::Sub(grid.Y(block), g.y)), &trans);
      hn::Store(trans, d, t);
      const V w = hn::Mul(a, before);
      float* out = acc + block * step;
      for (int c = 0; c < C; ++c, out += lanes) {
        hn::Store(hn::MulAdd(w, hn::Set(d, record[kRecordFeatures + c]), hn::Load(d, out)), d, out);
      }
      if (AllOpaque(trans)) alive &= ~(uint64_t{1} << block);
      ++evaluations;
    }
  }
  std::fill(job.block_masks + k, job.block_masks + job.count, 0);

  for (int block = 0; block < layout.blocks; ++block) {
    const V t = hn::Abs(hn::Load(d, T + block * lanes));
    float* out = acc + block * step;
    for (int c = 0; c < C; ++c, out += lanes) {
      hn::Store(hn::MulAdd(t, hn::Set(d, job.background[c]), hn::Load(d, out)), d, out);
    }
    hn::Store(hn::Sub(hn::Set(d, 1.0f), t), d, T + block * lanes);
  }
  const size_t plane = size_t(job.width) * job.height;
  for (int c = 0; c < C; ++c) StorePlane(job, layout, acc + c * lanes, step, image + c * plane);
  StorePlane(job, layout, T, lanes, alpha_out);
  return evaluations * lanes;
}

// Sums the lanes of each of n (a multiple of 4) vectors into out[n]: four vectors at a time are
// transposed and added, a third of the work of summing them one by one.
template <int n>
HWY_INLINE void SumLanes(const V* v, float* out) {
  const D d;
  const hn::RepartitionToWide<D> dw;
  const hn::Full128<float> d4;
  static_assert(n % 4 == 0);
  HWY_ALIGN float parts[16];
  const auto pair = [&](V a, V b) HWY_ATTR {
    return hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  };
  for (int i = 0; i < n; i += 4) {
    const auto p = hn::BitCast(dw, pair(v[i], v[i + 1])),
               q = hn::BitCast(dw, pair(v[i + 2], v[i + 3]));
    const V sums = hn::Add(hn::BitCast(d, hn::InterleaveLower(dw, p, q)),
                           hn::BitCast(d, hn::InterleaveUpper(dw, p, q)));
    hn::Store(sums, d, parts);
    auto total = hn::Load(d4, parts);
    for (size_t j = 4; j < hn::Lanes(d); j += 4) total = hn::Add(total, hn::Load(d4, parts + j));
    hn::StoreU(total, d4, out + i);
  }
}

template <int C>
void Backward(const TileJob& job, const uint32_t* slots, const float* v_image, const float* v_alpha,
              float* grads, TileScratch* scratch) {
  const D d;
  const Layout layout;
  const PixelGrid grid(job, layout);
  const int lanes = layout.lanes;
  constexpr int kStride = RecordStride(C), kGrads = GradStride(C);
  HWY_ALIGN float T[kTilePixels];
  HWY_ALIGN float behind[kTilePixels];  // dL/dweight of everything behind, per unit transmittance
  HWY_ALIGN float v[C * kTilePixels];   // [block][channel][lane], as in Forward
  const int step = C * lanes;
  const size_t plane = size_t(job.width) * job.height;
  for (int c = 0; c < C; ++c) LoadPlane(job, layout, v_image + c * plane, step, v + c * lanes);
  if (v_alpha != nullptr) {
    LoadPlane(job, layout, v_alpha, lanes, behind);
  } else {
    std::fill(behind, behind + kTilePixels, 0.0f);
  }
  for (int block = 0; block < layout.blocks; ++block) {
    V b = hn::Neg(hn::Load(d, behind + block * lanes));
    for (int c = 0; c < C; ++c) {
      b = hn::MulAdd(hn::Load(d, v + block * step + c * lanes), hn::Set(d, job.background[c]), b);
    }
    hn::Store(b, d, behind + block * lanes);
  }

  // Front to back once more, noting alpha and transmittance of every evaluation.
  InitTransmittance(job, layout, T);
  size_t evaluations = 0;
  for (size_t k = 0; k < job.count; ++k) evaluations += std::popcount(job.block_masks[k]);
  float* const noted = scratch->Reserve(evaluations * 2 * lanes);
  float* note = noted;
  for (size_t k = 0; k < job.count; ++k) {
    PrefetchAhead(job, k, kStride);
    const Gaussian g(job.records + size_t{job.gaussians[k]} * kStride);
    for (uint64_t rest = job.block_masks[k]; rest != 0; rest &= rest - 1) {
      const int block = std::countr_zero(rest);
      V trans = hn::Load(d, T + block * lanes);
      hn::Store(trans, d, note + lanes);
      hn::Store(Advance(Alpha(g, hn::Sub(grid.X(block), g.x), hn::Sub(grid.Y(block), g.y)), &trans),
                d, note);
      hn::Store(trans, d, T + block * lanes);
      note += 2 * lanes;
    }
  }

  // Back to front. With B the value behind per unit transmittance and q = v . feature:
  // dL/dalpha = T (q - B), and in front of this Gaussian B becomes alpha q + (1 - alpha) B.
  for (size_t k = job.count; k-- > 0;) {
    float* const out = grads + size_t{slots[k]} * kGrads;
    const uint64_t mask = job.block_masks[k];
    if (mask == 0) {
      std::fill(out, out + kGrads, 0.0f);
      continue;
    }
    const float* record = job.records + size_t{job.gaussians[k]} * kStride;
    const Gaussian g(record);
    V sum[kGrads];
    for (V& s : sum) s = hn::Zero(d);
    uint64_t rest = mask;
    while (rest != 0) {
      const int block = 63 - std::countl_zero(rest);
      rest &= ~(uint64_t{1} << block);
      note -= 2 * lanes;
      const V alpha = hn::Load(d, note), trans = hn::Load(d, note + lanes);
      const V w = hn::Mul(alpha, trans);
      V q = hn::Zero(d);
      for (int c = 0; c < C; ++c) {
        const V vc = hn::Load(d, v + block * step + c * lanes);
        q = hn::MulAdd(vc, hn::Set(d, record[kRecordFeatures + c]), q);
        sum[kGradFeatures + c] = hn::MulAdd(w, vc, sum[kGradFeatures + c]);
      }
      const V b = hn::Load(d, behind + block * lanes);
      const V excess = hn::Sub(q, b);
      hn::Store(hn::MulAdd(alpha, excess, b), d, behind + block * lanes);
      // dL/d(ln alpha); nothing passes the clamp.
      const V gl = hn::IfThenElseZero(hn::Lt(alpha, hn::Set(d, kAlphaMax)), hn::Mul(w, excess));
      const V dx = hn::Sub(grid.X(block), g.x), dy = hn::Sub(grid.Y(block), g.y);
      const V gx = hn::Mul(gl, dx), gy = hn::Mul(gl, dy);
      sum[kGradSum] = hn::Add(sum[kGradSum], gl);
      sum[kGradX] = hn::Add(sum[kGradX], gx);
      sum[kGradY] = hn::Add(sum[kGradY], gy);
      sum[kGradXX] = hn::MulAdd(gx, dx, sum[kGradXX]);
      sum[kGradXY] = hn::MulAdd(gx, dy, sum[kGradXY]);
      sum[kGradYY] = hn::MulAdd(gy, dy, sum[kGradYY]);
      const V px = hn::MulAdd(hn::Add(g.a, g.a), gx, hn::Mul(g.b, gy));
      const V py = hn::MulAdd(hn::Add(g.c, g.c), gy, hn::Mul(g.b, gx));
      sum[kGradAbsX] = hn::Add(sum[kGradAbsX], hn::Abs(px));
      sum[kGradAbsY] = hn::Add(sum[kGradAbsY], hn::Abs(py));
    }
    SumLanes<kGrads>(sum, out);
    out[kGradAbsX] *= kLn2;  // record coefficients are in units of log2
    out[kGradAbsY] *= kLn2;
  }
}

int64_t RasterizeTileImpl(const TileJob& job, float* image, float* alpha) {
  return job.channels == 3 ? Forward<3>(job, image, alpha)
                           : Forward<kNumChannels>(job, image, alpha);
}

void RasterizeTileVjpImpl(const TileJob& job, const uint32_t* slots, const float* v_image,
                          const float* v_alpha, float* grads, TileScratch* scratch) {
  if (job.channels == 3) return Backward<3>(job, slots, v_image, v_alpha, grads, scratch);
  Backward<kNumChannels>(job, slots, v_image, v_alpha, grads, scratch);
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(RasterizeTileImpl);
HWY_EXPORT(RasterizeTileVjpImpl);

float* TileScratch::Reserve(size_t floats) {
  if (floats > size) {
    size = floats + floats / 2;
    data = hwy::AllocateAligned<float>(size);
  }
  return data.get();
}

int64_t RasterizeTile(const TileJob& job, float* image, float* alpha) {
  return HWY_DYNAMIC_DISPATCH(RasterizeTileImpl)(job, image, alpha);
}

void RasterizeTileVjp(const TileJob& job, const uint32_t* slots, const float* v_image,
                      const float* v_alpha, float* grads, TileScratch* scratch) {
  HWY_DYNAMIC_DISPATCH(RasterizeTileVjpImpl)(job, slots, v_image, v_alpha, grads, scratch);
}

}  // namespace litags
#endif  // HWY_ONCE
