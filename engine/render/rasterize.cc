#include "engine/render/rasterize.h"

#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/rasterize.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"
// After highway.h: these define per-target code.
#include "engine/render/ellipse-inl.h"
#include "engine/render/rasterize-inl.h"
#include "hwy/cache_control.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Part of a tile's list: where its records are, and the fields of each that make its ellipse.
struct Chunk {
  static_assert(kRecordShear == 3 && kRecordAspect == 4 && kRecordDyRight == 5);

  const float* records[kChunk];
  HWY_ALIGN float fields[2][kChunk][4];  // 0 .. 3 and 4 .. 7 of the record

  void Load(const TileJob& job, size_t begin, size_t stride) {
    const hn::FixedTag<float, 4> d;
    const size_t count = std::min<size_t>(kChunk, job.count - begin);
    for (size_t k = 0; k < count; ++k) {
      records[k] = job.records + job.gaussians[begin + k] * stride;
      for (int i = 0; i < 2; ++i) hn::Store(hn::Load(d, records[k] + 4 * i), d, fields[i][k]);
    }
    for (size_t k = count; k < kChunk; ++k) {  // reach nothing
      for (int i = 0; i < 2; ++i) hn::Store(hn::Zero(d), d, fields[i][k]);
      fields[0][k][kRecordHalfHeight] = -1;
    }
  }

  // Lists are in depth order, records in memory order: without help every entry waits for memory.
  static HWY_INLINE void Prefetch(const TileJob& job, size_t begin, size_t end, size_t stride) {
    for (size_t k = begin; k < std::min(job.count, end); ++k) {
      const float* record = job.records + job.gaussians[k] * stride;
      hwy::Prefetch(record);
      hwy::Prefetch(record + stride - 1);
    }
  }
};

HWY_INLINE uint64_t MaskBits(M mask) {
  uint8_t bytes[8];  // as many are written as the lanes need
  hn::StoreMaskBits(D(), mask, bytes);
  if constexpr (kLanes <= 8) return bytes[0];
  uint16_t bits;
  std::memcpy(&bits, bytes, sizeof(bits));
  return bits;
}

// Sets reach[b], bit k, if Gaussian k of the chunk covers a pixel centre of block b.
HWY_INLINE void FindReach(const Chunk& chunk, const TileJob& job, uint64_t* reach) {
  const D d;
  std::fill_n(reach, kBlocks, 0);
  for (int k = 0; k < kChunk; k += kLanes) {
    Ellipse<V> ellipse;
    V unused;
    hn::LoadInterleaved4(d, chunk.fields[0][k], ellipse.x, ellipse.y, ellipse.half_height,
                         ellipse.shear);
    hn::LoadInterleaved4(d, chunk.fields[1][k], ellipse.aspect, ellipse.dy_right, unused, unused);
    for (int row = 0; row < kRows; ++row) {
      const float y = static_cast<float>(job.y0 + row * kBlockHeight);
      const Columns<V> columns =
          ColumnsOfRows(d, ellipse, hn::Set(d, y), hn::Set(d, y + kBlockHeight - 1), job.x0);
      const M some = hn::Le(columns.first, columns.last);
      for (int column = 0; column < kColumns; ++column) {
        const float x = static_cast<float>(column * kBlockWidth);
        const M here = hn::And(some, hn::And(hn::Le(columns.first, hn::Set(d, x + kBlockWidth - 1)),
                                             hn::Ge(columns.last, hn::Set(d, x))));
        reach[row * kColumns + column] |= MaskBits(here) << k;
      }
    }
  }
}

// Sums that compositing C channels takes. Of depth: all that is there, what makes the surface, and
// the weight of that.
template <int C>
constexpr int kSums = C == kDepthOnly ? 3 : C;

// A block's compositing state. [sum][lane]
template <int C>
struct BlockState {
  HWY_ALIGN float acc[kSums<C> * kLanes];
  HWY_ALIGN float product[kLanes];  // see Advance
  HWY_ALIGN float T[kLanes];        // transmittance, also of opaque pixels
};

// Adds a Gaussian of weight w, which takes the transmittance to `product`, at pixel centres (x, y).
template <int C>
HWY_INLINE void AddGaussian(const float* record, V x, V y, V w, const Step& step, V product,
                            V* acc) {
  const D d;
  if constexpr (C == kDepthOnly) {
    const V dx = hn::Sub(x, hn::Set(d, record[kRecordX]));
    const V dy = hn::Sub(y, hn::Set(d, record[kRecordY]));
    const V z_mean = hn::Set(d, record[kRecordFeatures]);
    const V tilt = hn::MulAdd(hn::Set(d, record[kRecordDzDx]), dx,
                              hn::Mul(hn::Set(d, record[kRecordDzDy]), dy));
    const V reach = hn::Mul(hn::Set(d, kSurfaceTilt), z_mean);
    const V z = hn::Add(z_mean, hn::Min(hn::Max(tilt, hn::Neg(reach)), reach));
    const V part = hn::Sub(hn::Min(step.before, hn::Set(d, kSurfaceFrom)),
                           hn::Max(product, hn::Set(d, kSurfaceTo)));
    const V surface = hn::IfThenElseZero(step.counts, hn::ZeroIfNegative(part));
    acc[0] = hn::MulAdd(w, z, acc[0]);
    acc[1] = hn::MulAdd(surface, z, acc[1]);
    acc[2] = hn::Add(surface, acc[2]);
  } else {
#pragma GCC unroll 16
    for (int c = 0; c < C; ++c) {
      acc[c] = hn::MulAdd(w, hn::Set(d, record[kRecordFeatures + c]), acc[c]);
    }
  }
}

// LITA-GS Eq. 8: sum of p alpha G2D times the product of 1 - alpha G2D before.
// Composites the Gaussians of `reach` over a block, front to back. Returns those that came before
// the block was opaque, and whether it is now.
template <int C>
HWY_INLINE uint64_t CompositeBlock(const float* const* records, uint64_t reach, V x, V y,
                                   BlockState<C>* state, bool* opaque) {
  const D d;
  HWY_ALIGN float alphas[kBatch * kLanes];
  const float* entries[kBatch];
  V product = hn::Load(d, state->product), T = hn::Load(d, state->T);
  V acc[kSums<C>];
#pragma GCC unroll 16
  for (int c = 0; c < kSums<C>; ++c) acc[c] = hn::Load(d, state->acc + c * kLanes);
  *opaque = false;
  uint64_t rest = reach;
  do {
    uint64_t batch = rest;
    int n = 0;
    do {
      entries[n] = records[std::countr_zero(rest)];
      hn::Store(Log2Alpha(entries[n], x, y), d, alphas + n * kLanes);
      ++n;
      rest &= rest - 1;
    } while (n < kBatch && rest != 0);
    AlphasOf(alphas, n, kLanes);

    product = DropOpaque(product);
    for (int i = 0; i < n; ++i) {
      const float* record = entries[i];
      const V alpha = hn::Load(d, alphas + i * kLanes);
      const Step step = Advance(alpha, &product);
      const V w = hn::Mul(alpha, hn::IfThenElseZero(step.counts, step.before));
      T = hn::IfThenElse(step.counts, product, T);
      AddGaussian<C>(record, x, y, w, step, product, acc);
      batch &= batch - 1;
      if (hn::AllFalse(d, step.counts)) {
        *opaque = true;
        rest |= batch;
        break;
      }
    }
  } while (rest != 0 && !*opaque);
#pragma GCC unroll 16
  for (int c = 0; c < kSums<C>; ++c) hn::Store(acc[c], d, state->acc + c * kLanes);
  hn::Store(product, d, state->product);
  hn::Store(T, d, state->T);
  return reach ^ rest;
}

// Asks for a share of the lines that the tile will be written to, a block's at a time.
HWY_INLINE void PrefetchOutput(const TileJob& job, int block, float* image, float* alpha) {
  if (block * kTileSize % kBlocks != 0) return;  // more blocks than rows
  const int y = job.y0 + block * kTileSize / kBlocks;
  if (y >= job.height) return;
  const size_t plane = size_t(job.width) * job.height, at = size_t(y) * job.width + job.x0;
  const int kept = std::popcount(job.kept_channels);
  for (int k = 0; k < kept; ++k) hwy::Prefetch(image + k * plane + at);
  hwy::Prefetch(alpha + at);
}

// The image's values from the sums, in their place.
template <int C>
HWY_INLINE void FinishSums(const TileJob& job, V T, float* acc) {
  const D d;
  if constexpr (C == kDepthOnly) {
    const V alpha = hn::Sub(hn::Set(d, 1.0f), T), weight = hn::Load(d, acc + 2 * kLanes);
    const M surface = hn::Gt(weight, hn::Zero(d));
    const V sum = hn::IfThenElse(surface, hn::Load(d, acc + kLanes), hn::Load(d, acc));
    const V depth = hn::Div(sum, hn::IfThenElse(surface, weight, alpha));
    hn::Store(hn::IfThenElseZero(hn::Gt(alpha, hn::Set(d, 1e-3f)), depth), d, acc);
  } else {
    for (int c = 0; c < C; ++c, acc += kLanes) {
      hn::Store(hn::MulAdd(T, hn::Set(d, job.background[c]), hn::Load(d, acc)), d, acc);
    }
  }
}

template <int C>
HWY_INLINE void FinishBlock(const TileJob& job, int block, BlockState<C>* state, float* image,
                            float* alpha) {
  const D d;
  const V T = hn::Load(d, state->T);
  FinishSums<C>(job, T, state->acc);
  hn::Store(hn::Sub(hn::Set(d, 1.0f), T), d, state->T);
  const size_t plane = size_t(job.width) * job.height;
  ForEachBlockRow(job, block, [&](size_t at, int from, auto columns) HWY_ATTR {
    float* to = image + at;
    for (int c = 0; c < C; ++c) {
      if ((job.kept_channels >> c & 1) == 0) continue;
      CopyRow(state->acc + c * kLanes + from, columns, to);
      to += plane;
    }
    CopyRow(state->T + from, columns, alpha + at);
  });
}

template <int C>
int64_t Forward(const TileJob& job, float* image, float* alpha) {
  const D d;
  const PixelGrid grid(job);
  BlockState<C> states[kBlocks] = {};
  uint64_t alive = 0;  // blocks that are not opaque
  for (int block = 0; block < kBlocks; ++block) {
    const V product = InitialProduct(job, grid.X(block), grid.Y(block));
    hn::Store(product, d, states[block].product);
    hn::Store(hn::Set(d, 1.0f), d, states[block].T);
    if (!hn::AllFalse(d, hn::Gt(product, hn::Zero(d)))) alive |= uint64_t{1} << block;
  }

  constexpr size_t kStride = RecordStride(C);
  Chunk chunk;
  int64_t evaluations = 0;
  for (size_t begin = 0; begin < job.count; begin += kChunk) {
    uint64_t* reach = job.reach + begin / kChunk * kMaxTileBlocks;
    if (alive == 0) {
      std::fill_n(reach, kBlocks, 0);
      continue;
    }
    chunk.Load(job, begin, kStride);
    FindReach(chunk, job, reach);
    for (int block = 0; block < kBlocks; ++block) {
      constexpr int kShare = kChunk / kBlocks;  // of the next chunk
      Chunk::Prefetch(job, begin + kChunk + block * kShare, begin + kChunk + (block + 1) * kShare,
                      kStride);
      if (begin == 0) PrefetchOutput(job, block, image, alpha);
      if ((alive >> block & 1) == 0) reach[block] = 0;
      if (reach[block] == 0) continue;
      bool opaque;
      reach[block] = CompositeBlock<C>(chunk.records, reach[block], grid.X(block), grid.Y(block),
                                       &states[block], &opaque);
      evaluations += std::popcount(reach[block]) * kLanes;
      if (opaque) alive &= ~(uint64_t{1} << block);
    }
  }
  for (int block = 0; block < kBlocks; ++block) {
    FinishBlock(job, block, &states[block], image, alpha);
  }
  return evaluations;
}

int64_t RasterizeTileImpl(const TileJob& job, float* image, float* alpha) {
  switch (job.channels) {
    case kDepthOnly:
      return Forward<kDepthOnly>(job, image, alpha);
    case kColorOnly:
      return Forward<kColorOnly>(job, image, alpha);
    case kColorAndNoise:
      return Forward<kColorAndNoise>(job, image, alpha);
    case kWithoutNoise:
      return Forward<kWithoutNoise>(job, image, alpha);
    default:
      return Forward<kNumChannels>(job, image, alpha);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(RasterizeTileImpl);

int64_t RasterizeTile(const TileJob& job, float* image, float* alpha) {
  return HWY_DYNAMIC_DISPATCH(RasterizeTileImpl)(job, image, alpha);
}

}  // namespace litags
#endif  // HWY_ONCE
