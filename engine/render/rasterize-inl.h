// What the forward and backward compositing kernels share, per target. Include after highway.h.
#if defined(LITAGS_ENGINE_RENDER_RASTERIZE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LITAGS_ENGINE_RENDER_RASTERIZE_INL_H_
#undef LITAGS_ENGINE_RENDER_RASTERIZE_INL_H_
#else
#define LITAGS_ENGINE_RENDER_RASTERIZE_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "engine/render/constants.h"
#include "engine/render/projection.h"
#include "engine/render/rasterize.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

// How blocks tile the tile for this target's vector length.
constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
constexpr int kColumns = kTileSize / kBlockWidth;
constexpr int kBlockHeight = kLanes / kBlockWidth;
constexpr int kRows = kTileSize / kBlockHeight;
constexpr int kBlocks = kRows * kColumns;
static_assert(kBlocks <= kMaxTileBlocks);

constexpr int BlockX(int block) { return block % kColumns * kBlockWidth; }
constexpr int BlockY(int block) { return block / kColumns * kBlockHeight; }

// 2^x for x in [-126, 126], to 2.4e-7 relative; meaningless for smaller x. Degree-5 minimax
// polynomial on [-1/2, 1/2], fitted for this project.
HWY_INLINE V Exp2(V x) {
  const D d;
  const hn::RebindToSigned<D> di;
  // Adding 1.5 2^23 rounds to an integer and leaves it in the low bits.
  const V magic = hn::Set(d, 12582912.0f);
  const V shifted = hn::Add(x, magic);
  const V f = hn::Sub(x, hn::Sub(shifted, magic));
  // In pairs (Estrin): the chain of dependent steps is what limits compositing.
  const V f2 = hn::Mul(f, f);
  const V p01 = hn::MulAdd(hn::Set(d, 0.6931469440f), f, hn::Set(d, 1.0000001192f));
  const V p23 = hn::MulAdd(hn::Set(d, 0.0555071309f), f, hn::Set(d, 0.2402212024f));
  const V p45 = hn::MulAdd(hn::Set(d, 0.0013276470f), f, hn::Set(d, 0.0096755410f));
  const V p = hn::MulAdd(hn::MulAdd(p45, f2, p23), f2, p01);
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::BitCast(di, shifted))));
}

// log2 of a Gaussian's alpha at pixel centres (x, y), at most log2 of its opacity.
HWY_INLINE V Log2Alpha(const float* HWY_RESTRICT record, V x, V y) {
  const D d;
  const V dx = hn::Sub(hn::Set(d, record[kRecordX]), x);
  const V dy = hn::Sub(hn::Set(d, record[kRecordY]), y);
  const V along_x =
      hn::MulAdd(hn::Set(d, record[kRecordA]), dx, hn::Mul(hn::Set(d, record[kRecordB]), dy));
  const V log2_opacity = hn::Set(d, record[kRecordLog2Opacity]);
  const V along_y = hn::MulAdd(hn::Mul(hn::Set(d, record[kRecordC]), dy), dy, log2_opacity);
  // Of a needle whose mean is thousands of pixels away the terms cancel to anything.
  return hn::Min(hn::MulAdd(along_x, dx, along_y), log2_opacity);
}

// Replaces n log2 of alpha, `stride` floats apart, by alpha: at most 0.99, zero below 1/255. A loop
// of its own: more exponentials are on their way at once than with what comes before them.
HWY_INLINE void AlphasOf(float* HWY_RESTRICT log2_alphas, size_t n, size_t stride) {
  const D d;
  for (size_t i = 0; i < n; ++i, log2_alphas += stride) {
    const V power = hn::Load(d, log2_alphas);
    const V alpha = hn::IfThenElseZero(hn::Ge(power, hn::Set(d, kLog2AlphaMin)),
                                       hn::Min(Exp2(power), hn::Set(d, kAlphaMax)));
    hn::Store(alpha, d, log2_alphas);
  }
}

// at[byte]: the positions of its bits that are set, in order, then zeros.
struct ByteBits {
  alignas(64) uint8_t at[256][8] = {};
  constexpr ByteBits() {
    for (int byte = 0; byte < 256; ++byte) {
      for (int bit = 0, n = 0; bit < 8; ++bit) {
        if (byte >> bit & 1) at[byte][n++] = static_cast<uint8_t>(bit);
      }
    }
  }
};
inline constexpr ByteBits kByteBits;

// Writes first + the position of every bit of the word that is set, in order, and up to 8 numbers
// more. Returns how many are set. No branch: the bits are as good as random.
HWY_INLINE size_t ListBits(uint64_t word, uint32_t first, uint32_t* HWY_RESTRICT out) {
  const hn::CappedTag<uint32_t, 8> d;
  const hn::Rebind<uint8_t, decltype(d)> d8;
  uint32_t* const begin = out;
#pragma GCC unroll 8
  for (int byte = 0; byte < 8; ++byte, word >>= 8, first += 8) {
    const uint8_t* bits = kByteBits.at[word & 255];
    for (size_t i = 0; i < 8; i += hn::Lanes(d)) {
      hn::StoreU(hn::Add(hn::PromoteTo(d, hn::Load(d8, bits + i)), hn::Set(d, first)), d, out + i);
    }
    out += std::popcount(word & 255);
  }
  return out - begin;
}

// Entries of a list whose alphas are evaluated together, before they are composited. In one loop
// the sums over channels would wait for the exponential in the processor's queues and keep the next
// entry's arithmetic out.
constexpr int kBatch = 16;

// One step of compositing. `product` is the product of 1 - alpha so far: the transmittance, or less
// than kTransmittanceStop where the pixel is opaque (and from the start outside the image).
struct Step {
  V before;  // transmittance in front of the Gaussian
  M counts;  // the pixel is not opaque, nor becomes so
};
HWY_INLINE Step Advance(V alpha, V* product) {
  const D d;
  const V before = *product;
  *product = hn::NegMulAdd(alpha, before, before);
  return {before, hn::Ge(*product, hn::Set(d, kTransmittanceStop))};
}

// To be called every kBatch steps: products of opaque pixels must not become denormal.
HWY_INLINE V DropOpaque(V product) {
  return hn::IfThenElseZero(hn::Ge(product, hn::Set(D(), kTransmittanceStop)), product);
}

// Pixel centres of a tile's blocks.
class PixelGrid {
 public:
  explicit PixelGrid(const TileJob& job) {
    HWY_ALIGN float xs[kLanes], ys[kLanes];
    for (int i = 0; i < kLanes; ++i) {
      xs[i] = job.x0 + i % kBlockWidth + 0.5f;
      ys[i] = job.y0 + i / kBlockWidth + 0.5f;
    }
    x_ = hn::Load(D(), xs);
    y_ = hn::Load(D(), ys);
  }
  HWY_INLINE V X(int block) const {
    return hn::Add(x_, hn::Set(D(), static_cast<float>(BlockX(block))));
  }
  HWY_INLINE V Y(int block) const {
    return hn::Add(y_, hn::Set(D(), static_cast<float>(BlockY(block))));
  }

 private:
  V x_, y_;  // of the first block
};

// The first `product` of a block's pixels: 1 inside the image, 0 outside.
HWY_INLINE V InitialProduct(const TileJob& job, V x, V y) {
  const D d;
  const M inside = hn::And(hn::Lt(x, hn::Set(d, static_cast<float>(job.width))),
                           hn::Lt(y, hn::Set(d, static_cast<float>(job.height))));
  return hn::IfThenElseZero(inside, hn::Set(d, 1.0f));
}

// Calls visit(offset in the image plane, offset in the block, columns) for every row of the block
// that has pixels inside the image. `columns` is a constant for whole rows.
template <class Visit>
HWY_INLINE void ForEachBlockRow(const TileJob& job, int block, Visit&& visit) {
  const int x = job.x0 + BlockX(block), columns = std::min(kBlockWidth, job.width - x);
  if (columns <= 0) return;
  const int y0 = job.y0 + BlockY(block), rows = std::min(kBlockHeight, job.height - y0);
  for (int r = 0; r < rows; ++r) {
    const size_t at = size_t(y0 + r) * job.width + x;
    if (columns == kBlockWidth) {
      visit(at, r * kBlockWidth, std::integral_constant<int, kBlockWidth>());
    } else {
      visit(at, r * kBlockWidth, columns);
    }
  }
}

HWY_INLINE void CopyRow(const float* from, int columns, float* to) {
  std::copy_n(from, columns, to);
}
HWY_INLINE void CopyRow(const float* from, std::integral_constant<int, kBlockWidth>, float* to) {
  const hn::FixedTag<float, kBlockWidth> d;
  hn::StoreU(hn::LoadU(d, from), d, to);
}

// R rows of four pixels, `width` apart. They are joined in registers: a vector read of what was
// just written in parts would wait.
template <int R>
HWY_INLINE auto LoadRows(const float* p, size_t width) {
  const hn::FixedTag<float, R * kBlockWidth> d;
  if constexpr (R == 1) {
    return hn::LoadU(d, p);
  } else {
    return hn::Combine(d, LoadRows<R / 2>(p + R / 2 * width, width), LoadRows<R / 2>(p, width));
  }
}

// The block's pixels of an image plane; zero outside the image.
HWY_INLINE V LoadBlock(const TileJob& job, int block, const float* plane) {
  const D d;
  const int x = job.x0 + BlockX(block), y = job.y0 + BlockY(block);
  if (x + kBlockWidth > job.width || y + kBlockHeight > job.height) {
    HWY_ALIGN float pixels[kLanes] = {};
    ForEachBlockRow(job, block, [&](size_t at, int to, int columns) {
      std::copy_n(plane + at, columns, pixels + to);
    });
    return hn::Load(d, pixels);
  }
  return LoadRows<kBlockHeight>(plane + size_t(y) * job.width + x, job.width);
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#endif  // LITAGS_ENGINE_RENDER_RASTERIZE_INL_H_
