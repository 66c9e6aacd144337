#include "engine/denoise/conv3x3.h"

#include <algorithm>

#ifndef LITAGS_ENGINE_DENOISE_CONV3X3_CONSTANTS_
#define LITAGS_ENGINE_DENOISE_CONV3X3_CONSTANTS_
namespace litags {
namespace {
// G of F(4,3), [transformed][ky]: Toom-Cook at the points 0, 1, -1, 2, -2 and
// infinity.
constexpr float kWeightTransform[kConvTransformed][3] = {
    {1.0f / 4, 0.0f, 0.0f},
    {-1.0f / 6, -1.0f / 6, -1.0f / 6},
    {-1.0f / 6, 1.0f / 6, -1.0f / 6},
    {1.0f / 24, 1.0f / 12, 1.0f / 6},
    {1.0f / 24, -1.0f / 12, 1.0f / 6},
    {0.0f, 0.0f, 1.0f},
};
}  // namespace
}  // namespace litags
#endif  // LITAGS_ENGINE_DENOISE_CONV3X3_CONSTANTS_

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/denoise/conv3x3.cc"
#include "hwy/cache_control.h"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
// At most 8 lanes: of 16, nearly every load of a pixel's neighbours crosses a cache line, and
// processors whose 512-bit units are 256 bits wide gain nothing for it.
using D = HWY_CAPPED(float, 8);
using V = hn::Vec<D>;

// Vectors of pixels per register block: as many as leave the compiler room to keep the sums, the
// inputs and a weight in registers (32 on ARM, 16 on AVX2 and SSE4). AVX-512 has 32, too, but
// blocks of 3 or 4 vectors take 7 to 10 % longer there.
constexpr int PixelVectors(int out_channels) {
  if (HWY_ARCH_ARM_A64) return 4;
  return HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3 ? 2 : out_channels == 3 ? 3 : 2;
}

// t[j] = (B d)[j] for the rows d of one channel; `count` floats each, a
// multiple of a vector.
void TransformInput(const float* const rows[kConvTransformed], size_t count, float* t,
                    size_t t_stride) {
  const D d;
  const V two = hn::Set(d, 2.0f), four = hn::Set(d, 4.0f), five = hn::Set(d, 5.0f);
  for (size_t x = 0; x < count; x += hn::MaxLanes(d)) {
    const V d0 = hn::Load(d, rows[0] + x), d1 = hn::Load(d, rows[1] + x);
    const V d2 = hn::Load(d, rows[2] + x), d3 = hn::Load(d, rows[3] + x);
    const V d4 = hn::Load(d, rows[4] + x), d5 = hn::Load(d, rows[5] + x);
    const V even4 = hn::NegMulAdd(four, d2, d4), odd4 = hn::NegMulAdd(four, d1, d3);
    const V even = hn::Sub(d4, d2), odd = hn::Mul(two, hn::Sub(d3, d1));
    hn::Store(hn::MulAdd(four, d0, hn::NegMulAdd(five, d2, d4)), d, t + x);
    hn::Store(hn::Add(even4, odd4), d, t + t_stride + x);
    hn::Store(hn::Sub(even4, odd4), d, t + 2 * t_stride + x);
    hn::Store(hn::Add(even, odd), d, t + 3 * t_stride + x);
    hn::Store(hn::Sub(even, odd), d, t + 4 * t_stride + x);
    hn::Store(hn::MulAdd(four, d1, hn::NegMulAdd(five, d3, d5)), d, t + 5 * t_stride + x);
  }
}

// t[j] = (A v)[j], the adjoint of the output transform.
void TransformGradient(const float* const rows[kConvRows], size_t count, float* t,
                       size_t t_stride) {
  const D d;
  const V two = hn::Set(d, 2.0f), four = hn::Set(d, 4.0f);
  for (size_t x = 0; x < count; x += hn::MaxLanes(d)) {
    const V v0 = hn::Load(d, rows[0] + x), v1 = hn::Load(d, rows[1] + x);
    const V v2 = hn::Load(d, rows[2] + x), v3 = hn::Load(d, rows[3] + x);
    const V even = hn::Add(v0, v2), odd = hn::Add(v1, v3);
    const V even4 = hn::MulAdd(four, v2, v0), odd4 = hn::Mul(two, hn::MulAdd(four, v3, v1));
    hn::Store(v0, d, t + x);
    hn::Store(hn::Add(even, odd), d, t + t_stride + x);
    hn::Store(hn::Sub(even, odd), d, t + 2 * t_stride + x);
    hn::Store(hn::Add(even4, odd4), d, t + 3 * t_stride + x);
    hn::Store(hn::Sub(even4, odd4), d, t + 4 * t_stride + x);
    hn::Store(v3, d, t + 5 * t_stride + x);
  }
}

// Whole padded row y of channel c; rows further below the image are zero as
// well.
const float* PaddedRow(const PaddedRows& in, int y, int c) {
  return in.row(y < in.height() ? y : -1, c) - PaddedRows::kPad;
}

// out [kConvTransformed][channels][stride] of the rows y - 1 .. y + kConvRows.
void TransformInputRows(const PaddedRows& in, int y, float* out) {
  for (int c = 0; c < in.channels(); ++c, out += in.stride()) {
    const float* rows[kConvTransformed];
    for (int j = 0; j < kConvTransformed; ++j) rows[j] = PaddedRow(in, y - 1 + j, c);
    TransformInput(rows, in.stride(), out, in.row_stride());
  }
}

void TransformGradientRows(const PaddedRows& v, int y, float* out) {
  for (int c = 0; c < v.channels(); ++c, out += v.stride()) {
    const float* rows[kConvRows];
    for (int i = 0; i < kConvRows; ++i) rows[i] = PaddedRow(v, y + i, c);
    TransformGradient(rows, v.stride(), out, v.row_stride());
  }
}

struct RowJob {
  const ConvWeights* weights;
  const float* in;  // transformed, pixel 0 of the first row
  size_t in_stride;
  // Pixel 0 of channel 0 of the first row written, and what the epilogue reads there.
  float* out;
  const float* other;
  const float* base;
  size_t stride, row_stride;  // of the three
  int width, rows;            // rows that are inside the image
};

template <ConvEpilogue kEpilogue>
HWY_INLINE V Finish(V v, const RowJob& job, size_t at) {
  const D d;
  switch (kEpilogue) {
    case ConvEpilogue::kRelu:
      return hn::Max(v, hn::Zero(d));
    case ConvEpilogue::kReluVjp:
      return hn::IfThenElseZero(hn::Gt(hn::Load(d, job.other + at), hn::Zero(d)), v);
    case ConvEpilogue::kSubtract:
      return hn::Sub(v, hn::Load(d, job.other + at));
    case ConvEpilogue::kResidual:
      return hn::Sub(hn::Load(d, job.base + at), hn::Sub(hn::Load(d, job.other + at), v));
  }
}

// products [kConvTransformed][OC][P * N] of OC output channels from oc0 on, P vectors of pixels
// from x on.
template <int OC, int P>
HWY_INLINE void Multiply(const RowJob& job, int oc0, int x, float* HWY_RESTRICT products) {
  const D d;
  constexpr size_t N = hn::MaxLanes(d);
  const int in_channels = job.weights->in_channels;
  const float* HWY_RESTRICT w =
      job.weights->w.get() + size_t(oc0) * in_channels * kConvTransformed * 3;
  const float* HWY_RESTRICT in = job.in + x - 1;
  for (int j = 0; j < kConvTransformed; ++j) {
    V acc[OC][P];
#pragma GCC unroll 16
    for (int i = 0; i < OC * P; ++i) acc[i / P][i % P] = hn::Zero(d);
    for (int c = 0; c < in_channels; ++c, in += job.in_stride) {
#pragma GCC unroll 3
      for (int kx = 0; kx < 3; ++kx, w += OC) {
        V pixels[P];
#pragma GCC unroll 4
        for (int p = 0; p < P; ++p) pixels[p] = hn::LoadU(d, in + kx + p * N);
#pragma GCC unroll 4
        for (int o = 0; o < OC; ++o) {
          const V weight = hn::Set(d, w[o]);
#pragma GCC unroll 4
          for (int p = 0; p < P; ++p) acc[o][p] = hn::MulAdd(weight, pixels[p], acc[o][p]);
        }
      }
    }
#pragma GCC unroll 16
    for (int i = 0; i < OC * P; ++i, products += N) hn::Store(acc[i / P][i % P], d, products);
  }
}

// Rows written and read by the epilogue are more than the hardware follows.
template <int OC, int P, ConvEpilogue kEpilogue>
HWY_INLINE void PrefetchBlock(const RowJob& job, int oc0, int x) {
  constexpr int kLine = HWY_ALIGNMENT / sizeof(float);
  const int end = x + std::max(1, P * static_cast<int>(hn::MaxLanes(D())) / kLine) * kLine;
  for (int o = oc0; o < oc0 + OC; ++o) {
    for (int i = 0; i < job.rows; ++i) {
      const size_t row = o * job.stride + i * job.row_stride;
      for (size_t at = row + x; at < row + end; at += kLine) {
        hwy::Prefetch(job.out + at);
        if constexpr (kEpilogue != ConvEpilogue::kRelu) hwy::Prefetch(job.other + at);
        if constexpr (kEpilogue == ConvEpilogue::kResidual) hwy::Prefetch(job.base + at);
      }
    }
  }
}

// OC output channels from oc0 on, P vectors of pixels from x on, kConvRows rows. What lies past the
// width stays zero.
constexpr int kAhead = 64;  // pixels
template <int OC, int P, bool kTail, ConvEpilogue kEpilogue>
HWY_INLINE void ConvBlock(const RowJob& job, int oc0, int x) {
  const D d;
  constexpr size_t N = hn::MaxLanes(d);
  HWY_ALIGN float products[kConvTransformed * OC * P * N];
  if constexpr (!kTail) PrefetchBlock<OC, P, kEpilogue>(job, oc0, x + kAhead);
  Multiply<OC, P>(job, oc0, x, products);
  const V two = hn::Set(d, 2.0f), four = hn::Set(d, 4.0f), eight = hn::Set(d, 8.0f);
  for (int o = 0; o < OC; ++o) {
    const V bias = hn::Set(d, job.weights->bias[oc0 + o]);
#pragma GCC unroll 4
    for (int p = 0; p < P; ++p) {
      const auto m = [&](int j)
                         HWY_ATTR { return hn::Load(d, products + ((j * OC + o) * P + p) * N); };
      const V even = hn::Add(m(1), m(2)), odd = hn::Sub(m(1), m(2));
      const V even2 = hn::Add(m(3), m(4)), odd2 = hn::Sub(m(3), m(4));
      size_t at = (oc0 + o) * job.stride + x + p * N;
      const auto store = [&](int row, V v) HWY_ATTR {
        if (row >= job.rows) return;
        v = Finish<kEpilogue>(v, job, at);
        if constexpr (kTail) v = hn::IfThenElseZero(hn::FirstN(d, job.width - x), v);
        hn::Store(v, d, job.out + at);
        at += job.row_stride;
      };
      store(0, hn::Add(hn::Add(m(0), bias), hn::Add(even, even2)));
      store(1, hn::MulAdd(two, odd2, hn::Add(odd, bias)));
      store(2, hn::MulAdd(four, even2, hn::Add(even, bias)));
      store(3, hn::Add(hn::Add(m(5), bias), hn::MulAdd(eight, odd2, odd)));
    }
  }
}

template <int OC, ConvEpilogue kEpilogue>
void ConvRow(const RowJob& job) {
  constexpr int N = hn::MaxLanes(D()), P = PixelVectors(OC);
  const int channels = job.weights->out_channels;
  int x = 0;
  for (; x + P * N <= job.width; x += P * N) {
    for (int oc0 = 0; oc0 < channels; oc0 += OC) ConvBlock<OC, P, false, kEpilogue>(job, oc0, x);
  }
  for (; x < job.width; x += N) {
    for (int oc0 = 0; oc0 < channels; oc0 += OC) ConvBlock<OC, 1, true, kEpilogue>(job, oc0, x);
  }
}

template <ConvEpilogue kEpilogue>
void ConvRowOf(const RowJob& job) {
  if (ConvBlockSize(job.weights->out_channels) == 3) {
    ConvRow<3, kEpilogue>(job);
  } else {
    ConvRow<4, kEpilogue>(job);
  }
}

void Conv3x3Rows(const ConvLayer& layer, int y, float* scratch) {
  const PaddedRows &in = *layer.in, &out = *layer.out;
  TransformInputRows(in, y, scratch);
  const auto at = [&](const PaddedRows* rows) { return rows ? rows->row(y, 0) : nullptr; };
  const RowJob job = {layer.weights,   scratch + PaddedRows::kPad,
                      in.stride(),     layer.out->row(y, 0),
                      at(layer.other), at(layer.base),
                      out.stride(),    out.row_stride(),
                      out.width(),     std::min(kConvRows, out.height() - y)};
  switch (layer.epilogue) {
    case ConvEpilogue::kRelu:
      return ConvRowOf<ConvEpilogue::kRelu>(job);
    case ConvEpilogue::kReluVjp:
      return ConvRowOf<ConvEpilogue::kReluVjp>(job);
    case ConvEpilogue::kSubtract:
      return ConvRowOf<ConvEpilogue::kSubtract>(job);
    case ConvEpilogue::kResidual:
      return ConvRowOf<ConvEpilogue::kResidual>(job);
  }
}

// One row, OC output channels and the three horizontal taps of one input row:
// acc[o][kx] += sum over x of v_out[o][x] in[x + kx - 1], lane by lane.
template <int OC>
HWY_INLINE void WeightGradTaps(const float* v_out, size_t v_stride, const float* in, int width,
                               float* sums) {
  const D d;
  constexpr int N = hn::MaxLanes(d);
  V acc[OC][3];
#pragma GCC unroll 12
  for (int i = 0; i < OC * 3; ++i) acc[i / 3][i % 3] = hn::Load(d, sums + i * N);
  for (int x = 0; x < width; x += N) {
    const V left = hn::LoadU(d, in + x - 1);
    const V centre = hn::Load(d, in + x);
    const V right = hn::LoadU(d, in + x + 1);
#pragma GCC unroll 4
    for (int o = 0; o < OC; ++o) {
      const V v = hn::Load(d, v_out + o * v_stride + x);
      acc[o][0] = hn::MulAdd(v, left, acc[o][0]);
      acc[o][1] = hn::MulAdd(v, centre, acc[o][1]);
      acc[o][2] = hn::MulAdd(v, right, acc[o][2]);
    }
  }
#pragma GCC unroll 12
  for (int i = 0; i < OC * 3; ++i) hn::Store(acc[i / 3][i % 3], d, sums + i * N);
}

// Adds the rows y .. y + kConvRows - 1. `sums` holds a vector per transformed
// weight, [j][out / OC][in][OC][kx], then one per output channel.
template <int OC>
void WeightGradRow(const PaddedRows& in, const PaddedRows& v_out, int y, float* transformed,
                   float* sums) {
  const D d;
  constexpr int N = hn::MaxLanes(d);
  const int width = v_out.width();
  const size_t stride = in.stride();
  float* t_v = transformed + kConvTransformed * in.row_stride();
  TransformInputRows(in, y, transformed);
  TransformGradientRows(v_out, y, t_v);
  for (int j = 0; j < kConvTransformed; ++j) {
    const float* t_in = transformed + j * in.row_stride() + PaddedRows::kPad;
    const float* v = t_v + j * v_out.row_stride() + PaddedRows::kPad;
    for (int oc0 = 0; oc0 < v_out.channels(); oc0 += OC) {
      for (int c = 0; c < in.channels(); ++c, sums += OC * 3 * N) {
        WeightGradTaps<OC>(v + oc0 * stride, stride, t_in + c * stride, width, sums);
      }
    }
  }
  // The second transformed row is the sum of the four.
  const float* v = t_v + v_out.row_stride() + PaddedRows::kPad;
  for (int o = 0; o < v_out.channels(); ++o, sums += N, v += stride) {
    V acc = hn::Load(d, sums);
    for (int x = 0; x < width; x += N) acc = hn::Add(acc, hn::Load(d, v + x));
    hn::Store(acc, d, sums);
  }
}

void WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y, float* scratch,
                    float* sums) {
  if (ConvBlockSize(v_out.channels()) == 3) {
    WeightGradRow<3>(in, v_out, y, scratch, sums);
  } else {
    WeightGradRow<4>(in, v_out, y, scratch, sums);
  }
}

void WeightGradOfSums(int in_channels, int out_channels, const float* sums, float* v_w,
                      float* v_bias) {
  const D d;
  auto next_sum = [&] {
    const float total = hn::GetLane(hn::SumOfLanes(d, hn::Load(d, sums)));
    sums += hn::MaxLanes(d);
    return total;
  };
  std::fill_n(v_w, size_t(out_channels) * in_channels * 9, 0.0f);
  const int block = ConvBlockSize(out_channels);
  for (const auto& g : kWeightTransform) {
    for (int oc0 = 0; oc0 < out_channels; oc0 += block) {
      for (int c = 0; c < in_channels; ++c) {
        for (int o = oc0; o < oc0 + block; ++o) {
          float* taps = v_w + (size_t(o) * in_channels + c) * 9;
          for (int kx = 0; kx < 3; ++kx) {
            const float sum = next_sum();
            for (int ky = 0; ky < 3; ++ky) taps[3 * ky + kx] += g[ky] * sum;
          }
        }
      }
    }
  }
  for (int o = 0; o < out_channels; ++o) v_bias[o] = next_sum();
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(Conv3x3Rows);
HWY_EXPORT(WeightGradRows);
HWY_EXPORT(WeightGradOfSums);

// Fills w; weight(out, in, tap) are the plain weights.
template <typename Weight>
void PackTransformed(int in_channels, int out_channels, Weight weight, float* w) {
  const int block = ConvBlockSize(out_channels);
  for (int o0 = 0; o0 < out_channels; o0 += block) {
    for (const auto& g : kWeightTransform) {
      for (int c = 0; c < in_channels; ++c) {
        for (int kx = 0; kx < 3; ++kx) {
          for (int o = o0; o < o0 + block; ++o) {
            *w++ =
                g[0] * weight(o, c, kx) + g[1] * weight(o, c, 3 + kx) + g[2] * weight(o, c, 6 + kx);
          }
        }
      }
    }
  }
}

void Allocate(int in, int out, ConvWeights* weights) {
  if (in != weights->in_channels || out != weights->out_channels) {
    weights->in_channels = in;
    weights->out_channels = out;
    weights->w = hwy::AllocateAligned<float>(size_t(in) * out * 3 * kConvTransformed);
    weights->bias = hwy::AllocateAligned<float>(out);
  }
  std::fill_n(weights->bias.get(), out, 0.0f);
}

}  // namespace

void ConvWeights::Pack(int in, int out, const float* source, const float* source_bias) {
  Allocate(ConvPaddedChannels(in), ConvPaddedChannels(out), this);
  auto weight = [&](int o, int c, int tap) {
    return o < out && c < in ? source[(size_t(o) * in + c) * 9 + tap] : 0.0f;
  };
  PackTransformed(in_channels, out_channels, weight, w.get());
  std::copy_n(source_bias, out, bias.get());
}

void ConvWeights::PackTransposed(int in, int out, const float* source) {
  Allocate(ConvPaddedChannels(out), ConvPaddedChannels(in), this);
  auto weight = [&](int o, int c, int tap) {
    return o < in && c < out ? source[(size_t(c) * in + o) * 9 + 8 - tap] : 0.0f;
  };
  PackTransformed(in_channels, out_channels, weight, w.get());
}

void Conv3x3Rows(const ConvLayer& layer, int y, float* scratch) {
  HWY_DYNAMIC_DISPATCH(Conv3x3Rows)(layer, y, scratch);
}

size_t ConvScratch(const PaddedRows& in) { return kConvTransformed * in.row_stride(); }

size_t ConvWeightGradScratch(const PaddedRows& in, const PaddedRows& v_out) {
  return ConvScratch(in) + ConvScratch(v_out);
}

size_t ConvWeightGradSums(int in_channels, int out_channels) {
  return PaddedRows::kPad * out_channels * (in_channels * 3 * kConvTransformed + 1);
}

void Conv3x3WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y, float* scratch,
                           float* sums) {
  HWY_DYNAMIC_DISPATCH(WeightGradRows)(in, v_out, y, scratch, sums);
}

void Conv3x3WeightGradOfSums(int in_channels, int out_channels, const float* sums, float* v_w,
                             float* v_bias) {
  HWY_DYNAMIC_DISPATCH(WeightGradOfSums)(in_channels, out_channels, sums, v_w, v_bias);
}

}  // namespace litags
#endif  // HWY_ONCE
