#include "engine/render/rasterize.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/rasterize_vjp.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"
// After highway.h: these define per-target code.
#include "engine/render/rasterize-inl.h"
#include "hwy/cache_control.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Sums over pixels run with lanes across the summed quantities, not across pixels: a vector of
// eight moments, one or two of eight or sixteen channels. Nothing has to be added across lanes.
using DR = hn::CappedTag<float, 8>;
using VR = hn::Vec<DR>;
constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(DR()));
constexpr int kMoments = 8;  // 1, x, y, xx, xy, yy and two unused; GradStride's first eight
static_assert(kMoments == kGradFeatures && kGradSum == 0 && kGradX == 1 && kGradY == 2 &&
              kGradXX == 3 && kGradXY == 4 && kGradYY == 5);

// One evaluation of alpha in a block: [2][lane]. Alpha and the transmittance before it; then the
// weights with which pixels enter the sums over channels and over moments.
constexpr int kEvaluation = 2 * kLanes;

// Moments of a tile's pixel centres about the tile's centre. [block][lane][moment]
struct Basis {
  HWY_ALIGN float moments[kBlocks * kLanes * kMoments];
  Basis() {
    constexpr float kCenter = kTileSize / 2.0f - 0.5f;
    for (int i = 0; i < kBlocks * kLanes; ++i) {
      const int lane = i % kLanes;
      const float x = BlockX(i / kLanes) + lane % kBlockWidth - kCenter;
      const float y = BlockY(i / kLanes) + lane / kBlockWidth - kCenter;
      const float row[kMoments] = {1, x, y, x * x, x * y, y * y};
      std::copy_n(row, kMoments, moments + i * kMoments);
    }
  }
  static const float* OfBlock(int block) {
    static const Basis basis;
    return basis.moments + block * kLanes * kMoments;
  }
};

// What a block's pixels bring to the backward pass.
template <int C>
struct BlockInput {
  static constexpr int kChannelRow = GradStride(C) - kMoments;
  V x, y;
  const float* basis;
  HWY_ALIGN float v[C * kLanes];  // dL/dimage, [channel][lane]; 0 of detached channels
  HWY_ALIGN float rows[kLanes * kChannelRow] = {};  // dL/dimage of all channels, [lane][channel]
  HWY_ALIGN float behind[kLanes];                   // dL/dT_final: background less alpha

  void Load(const TileJob& job, const TileGradients& gradients, int block) {
    const D d;
    basis = Basis::OfBlock(block);
    const size_t plane = size_t(job.width) * job.height;
    for (int c = 0; c < C; ++c) {
      hn::Store(LoadBlock(job, block, gradients.v_image + c * plane), d, v + c * kLanes);
    }
    Transpose();
    for (int c = 0; c < C; ++c) {
      if (gradients.detached_channels >> c & 1) hn::Store(hn::Zero(d), d, v + c * kLanes);
    }
    V b = hn::Zero(d);
    if (gradients.v_alpha != nullptr) b = hn::Neg(LoadBlock(job, block, gradients.v_alpha));
    for (int c = 0; c < C; ++c) {
      b = hn::MulAdd(hn::Load(d, v + c * kLanes), hn::Set(d, job.background[c]), b);
    }
    hn::Store(b, d, behind);
  }

  // Four channels at a time.
  HWY_INLINE void Transpose() {
    const D d;
    const hn::FixedTag<float, 4> d4;
    HWY_ALIGN float pixels[4 * kLanes];
    static_assert((C + 3) / 4 * 4 <= kChannelRow);
    for (int c = 0; c < C; c += 4) {
      const auto channel = [&](int k) HWY_ATTR {
        return k < C ? hn::Load(d, v + k * kLanes) : hn::Zero(d);
      };
      hn::StoreInterleaved4(channel(c), channel(c + 1), channel(c + 2), channel(c + 3), d, pixels);
      for (int i = 0; i < kLanes; ++i) {
        hn::Store(hn::Load(d4, pixels + 4 * i), d4, rows + i * kChannelRow + c);
      }
    }
  }

  // Rows of a tile are too short for the hardware to fetch them ahead.
  static void Prefetch(const TileJob& job, const TileGradients& gradients) {
    const size_t plane = size_t(job.width) * job.height;
    const int rows = std::min(kTileSize, job.height - job.y0);
    const int last = std::min(kTileSize, job.width - job.x0) - 1;
    for (int c = 0; c < C; ++c) {
      for (int y = 0; y < rows; ++y) {
        const float* row = gradients.v_image + c * plane + size_t(job.y0 + y) * job.width + job.x0;
        hwy::Prefetch(row);
        hwy::Prefetch(row + last);
      }
    }
  }
};

// Front to back once more, noting alpha and transmittance of every evaluation.
template <int C>
HWY_INLINE void NoteEvaluations(const float* HWY_RESTRICT records, const uint32_t* entries,
                                size_t n, V product, const BlockInput<C>& in,
                                float* HWY_RESTRICT evaluations) {
  const D d;
  for (size_t begin = 0; begin < n; begin += kBatch) {
    const size_t end = std::min(n, begin + kBatch);
    for (size_t i = begin; i < end; ++i) {
      hn::Store(Log2Alpha(records + entries[i] * RecordStride(C), in.x, in.y), d,
                evaluations + i * kEvaluation);
    }
    AlphasOf(evaluations + begin * kEvaluation, end - begin, kEvaluation);
    product = DropOpaque(product);
    for (size_t i = begin; i < end; ++i) {
      float* evaluation = evaluations + i * kEvaluation;
      const V alpha = hn::Load(d, evaluation);
      const Step step = Advance(alpha, &product);
      // Not IfThenElseZero of alpha: compilers make a masked load of it, which waits on AVX-512
      // until the first loop's store has left for the cache.
      hn::Store(hn::Min(alpha, hn::IfThenElseZero(step.counts, hn::Set(d, 1.0f))), d, evaluation);
      hn::Store(step.before, d, evaluation + kLanes);
    }
  }
}

// Back to front. With B the value behind per unit transmittance and q = v . feature:
// dL/dalpha = T (q - B), and in front of this Gaussian B becomes alpha q + (1 - alpha) B.
// Replaces every evaluation by the pixels' weights dimage/dfeature = alpha T and
// dL/d(ln alpha) = alpha T (q - B).
template <int C>
HWY_INLINE void WeighEvaluations(const float* HWY_RESTRICT records, const uint32_t* entries,
                                 size_t n, const BlockInput<C>& in,
                                 float* HWY_RESTRICT evaluations) {
  const D d;
  V v[C];
#pragma GCC unroll 16
  for (int c = 0; c < C; ++c) v[c] = hn::Load(d, in.v + c * kLanes);
  V behind = hn::Load(d, in.behind);
  float* evaluation = evaluations + n * kEvaluation;
  for (size_t i = n; i-- > 0;) {
    evaluation -= kEvaluation;
    const float* record = records + entries[i] * RecordStride(C);
    const V alpha = hn::Load(d, evaluation), T = hn::Load(d, evaluation + kLanes);
    V part[3];  // one sum would be a chain three times as long
#pragma GCC unroll 16
    for (int c = 0; c < C; ++c) {
      const V feature = hn::Set(d, record[kRecordFeatures + c]);
      part[c % 3] = c < 3 ? hn::Mul(v[c], feature) : hn::MulAdd(v[c], feature, part[c % 3]);
    }
    const V q = hn::Add(part[0], hn::Add(part[1], part[2]));
    const V w = hn::Mul(alpha, T);
    const V excess = hn::Sub(q, behind);
    behind = hn::MulAdd(alpha, excess, behind);
    // Nothing passes the clamp.
    const V g = hn::IfThenElseZero(hn::Lt(alpha, hn::Set(d, kAlphaMax)), hn::Mul(w, excess));
    hn::Store(w, d, evaluation);
    hn::Store(g, d, evaluation + kLanes);
  }
}

// Evaluations whose sums are kept in registers together: as many as leave room for a vector of
// every pixel beside them.
constexpr int kGroup = kLanes == 16 ? 8 : 4;

// Adds the pixels of n evaluations (a multiple of kGroup) to one vector of their Gaussians' sums: a
// product of the weights [n][pixel] with rows [pixel][kStride].
template <int C, int kStride, class DS>
HWY_INLINE void AddPixelsTo(DS d, int offset, const uint32_t* entries, size_t n, const float* rows,
                            const float* HWY_RESTRICT weights, float* HWY_RESTRICT grads) {
  using VS = hn::Vec<DS>;
  VS row[kLanes];
#pragma GCC unroll 16
  for (int pixel = 0; pixel < kLanes; ++pixel) row[pixel] = hn::Load(d, rows + pixel * kStride);
  for (size_t i = 0; i < n; i += kGroup, weights += kGroup * kEvaluation) {
    VS sum[kGroup];
#pragma GCC unroll 16
    for (int j = 0; j < kGroup; ++j) {
      sum[j] = hn::LoadU(d, grads + entries[i + j] * GradStride(C) + offset);
    }
#pragma GCC unroll 16
    for (int pixel = 0; pixel < kLanes; ++pixel) {
#pragma GCC unroll 16
      for (int j = 0; j < kGroup; ++j) {
        sum[j] = hn::MulAdd(hn::Set(d, weights[j * kEvaluation + pixel]), row[pixel], sum[j]);
      }
    }
#pragma GCC unroll 16
    for (int j = 0; j < kGroup; ++j) {
      hn::StoreU(sum[j], d, grads + entries[i + j] * GradStride(C) + offset);
    }
  }
}

template <int C>
HWY_INLINE void AddPixels(const uint32_t* entries, size_t n, const BlockInput<C>& in,
                          const float* evaluations, float* grads) {
  constexpr int kChannelRow = BlockInput<C>::kChannelRow;
  const hn::CappedTag<float, kChannelRow> dc;
#pragma GCC unroll 4
  for (int m = 0; m < kMoments; m += kRowLanes) {
    AddPixelsTo<C, kMoments>(DR(), m, entries, n, in.basis + m, evaluations + kLanes, grads);
  }
#pragma GCC unroll 4
  for (int f = 0; f < kChannelRow; f += hn::MaxLanes(dc)) {
    AddPixelsTo<C, kChannelRow>(dc, kMoments + f, entries, n, in.rows + f, evaluations, grads);
  }
}

// Moments about the tile's centre to moments about the mean at (mx, my) from there.
HWY_INLINE void ShiftMoments(const float* m, float mx, float my, float* out) {
  const float s = m[kGradSum], x = m[kGradX], y = m[kGradY];
  out[kGradSum] = s;
  out[kGradX] = x - mx * s;
  out[kGradY] = y - my * s;
  out[kGradXX] = m[kGradXX] + mx * (mx * s - 2 * x);
  out[kGradXY] = m[kGradXY] + mx * my * s - mx * y - my * x;
  out[kGradYY] = m[kGradYY] + my * (my * s - 2 * y);
}

// Entries of the list that reach the block, in order.
HWY_INLINE size_t ListEntries(const TileJob& job, size_t used, int block, uint32_t* entries) {
  size_t n = 0;
  for (size_t begin = 0; begin < used; begin += kChunk) {
    n += ListBits(job.reach[begin / kChunk * kMaxTileBlocks + block], static_cast<uint32_t>(begin),
                  entries + n);
  }
  return n;
}

// Length of the list up to its last chunk that reaches any block.
HWY_INLINE size_t UsedLength(const TileJob& job) {
  size_t chunks = (job.count + kChunk - 1) / kChunk;
  const auto reaches = [&](size_t chunk) {
    const uint64_t* words = job.reach + chunk * kMaxTileBlocks;
    return std::any_of(words, words + kBlocks, [](uint64_t w) { return w != 0; });
  };
  while (chunks > 0 && !reaches(chunks - 1)) --chunks;
  return std::min(job.count, chunks * kChunk);
}

template <int C>
HWY_INLINE void GatherRecords(const TileJob& job, size_t used, AlignedFloats* records) {
  constexpr int kStride = RecordStride(C);
  constexpr size_t kAhead = 16;
  const DR d;
  records->resize(used * kStride);
  for (size_t k = 0; k < used; ++k) {
    if (k + kAhead < used) {
      const float* next = job.records + size_t{job.gaussians[k + kAhead]} * kStride;
      hwy::Prefetch(next);
      hwy::Prefetch(next + kStride - 1);
    }
    const float* from = job.records + size_t{job.gaussians[k]} * kStride;
    for (int i = 0; i < kStride; i += kRowLanes) {
      hn::Store(hn::LoadU(d, from + i), d, records->data() + k * kStride + i);
    }
  }
}

// Pairs are numbered by Gaussian, so they are far apart.
template <int C>
HWY_INLINE void StorePairs(const TileJob& job, const TileGradients& gradients, size_t used,
                           const float* records, const float* grads) {
  constexpr int kGrads = GradStride(C);
  constexpr size_t kAhead = 16;
  const DR d;
  for (size_t k = 0; k < job.count; ++k) {
    if (k + kAhead < job.count) {
      const float* next = gradients.pairs + size_t{gradients.slots[k + kAhead]} * kGrads;
      hwy::Prefetch(next);
      hwy::Prefetch(next + kGrads - 1);
    }
    float* to = gradients.pairs + size_t{gradients.slots[k]} * kGrads;
    if (k >= used) {
      std::fill_n(to, kGrads, 0.0f);
      continue;
    }
    const float* record = records + k * RecordStride(C);
    const float* from = grads + k * kGrads;
    ShiftMoments(from, record[kRecordX] - (job.x0 + kTileSize / 2),
                 record[kRecordY] - (job.y0 + kTileSize / 2), to);
    for (int i = kMoments; i < kGrads; i += kRowLanes) {
      hn::Store(hn::Load(d, from + i), d, to + i);
    }
  }
}

template <int C>
void Backward(const TileJob& job, const TileGradients& gradients, TileScratch* scratch) {
  const PixelGrid grid(job);
  constexpr int kGrads = GradStride(C);
  const size_t used = UsedLength(job);
  if (used > 0) BlockInput<C>::Prefetch(job, gradients);
  GatherRecords<C>(job, used, &scratch->records);
  const float* records = scratch->records.data();
  // One more row takes the sums of the entries that fill a group up.
  scratch->grads.assign((used + 1) * kGrads, 0.0f);
  scratch->entries.resize(used + kGroup + 8);  // 8 for ListBits
  scratch->evaluations.resize((used + kGroup) * kEvaluation);
  uint32_t* entries = scratch->entries.data();
  float* evaluations = scratch->evaluations.data();
  float* grads = scratch->grads.data();

  BlockInput<C> in;
  for (int block = 0; block < kBlocks; ++block) {
    const size_t n = ListEntries(job, used, block, entries);
    if (n == 0) continue;
    in.x = grid.X(block);
    in.y = grid.Y(block);
    in.Load(job, gradients, block);
    NoteEvaluations(records, entries, n, InitialProduct(job, in.x, in.y), in, evaluations);
    WeighEvaluations<C>(records, entries, n, in, evaluations);
    std::fill_n(entries + n, kGroup, static_cast<uint32_t>(used));
    std::fill_n(evaluations + n * kEvaluation, kGroup * kEvaluation, 0.0f);
    AddPixels(entries, (n + kGroup - 1) / kGroup * kGroup, in, evaluations, grads);
  }
  StorePairs<C>(job, gradients, used, records, grads);
}

void RasterizeTileVjpImpl(const TileJob& job, const TileGradients& gradients,
                          TileScratch* scratch) {
  switch (job.channels) {
    case kColorOnly:
      return Backward<kColorOnly>(job, gradients, scratch);
    case kWithoutNoise:
      return Backward<kWithoutNoise>(job, gradients, scratch);
    default:
      return Backward<kNumChannels>(job, gradients, scratch);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(RasterizeTileVjpImpl);

void RasterizeTileVjp(const TileJob& job, const TileGradients& gradients, TileScratch* scratch) {
  HWY_DYNAMIC_DISPATCH(RasterizeTileVjpImpl)(job, gradients, scratch);
}

}  // namespace litags
#endif  // HWY_ONCE
