#include "engine/denoise/conv3x3.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/denoise/conv3x3.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::ScalableTag<float>;
using V = hn::Vec<D>;

// Vectors of pixels per register block. With 4 output channels, 12 accumulators, 3 inputs and a
// weight fill the 16 registers of AVX2 and SSE4; targets with 32 registers take 16 + 4 + 1.
#if HWY_TARGET <= HWY_AVX3 || HWY_ARCH_ARM_A64
constexpr int kPixelVectors = 4;
#else
constexpr int kPixelVectors = 3;
#endif

V ApplyEpilogue(ConvEpilogue epilogue, V v, const float* other) {
  const D d;
  switch (epilogue) {
    case ConvEpilogue::kBias:
      return v;
    case ConvEpilogue::kRelu:
      return hn::Max(v, hn::Zero(d));
    case ConvEpilogue::kReluVjp:
      return hn::IfThenElseZero(hn::Gt(hn::Load(d, other), hn::Zero(d)), v);
    case ConvEpilogue::kSubtract:
      return hn::Sub(v, hn::Load(d, other));
  }
  return v;
}

struct RowJob {
  const ConvWeights* weights;
  const PaddedRows* in;
  const PaddedRows* other;
  PaddedRows* out;
  ConvEpilogue epilogue;
  int y;
};

// OC output channels from oc0 on, P vectors of pixels from x on.
template <int OC, int P>
HWY_INLINE void ConvBlock(const RowJob& job, int oc0, int x) {
  const D d;
  constexpr size_t N = hn::MaxLanes(d);
  const size_t stride = job.in->stride(), row_stride = job.in->row_stride();
  const int in_channels = job.weights->in_channels;
  const float* w = job.weights->w.get() + size_t(oc0) * in_channels * 9;
  const float* in = job.in->row(job.y - 1, 0) + x - 1;

  V acc[OC][P];
#pragma GCC unroll 4
  for (int o = 0; o < OC; ++o) {
    const V bias = hn::Set(d, job.weights->bias[oc0 + o]);
#pragma GCC unroll 4
    for (int p = 0; p < P; ++p) acc[o][p] = bias;
  }
  for (int c = 0; c < in_channels; ++c, in += stride) {
    const float* in_row = in;
    for (int ky = 0; ky < 3; ++ky, in_row += row_stride) {
#pragma GCC unroll 3
      for (int kx = 0; kx < 3; ++kx, w += OC) {
        V pixels[P];
#pragma GCC unroll 4
        for (int p = 0; p < P; ++p) pixels[p] = hn::LoadU(d, in_row + kx + p * N);
#pragma GCC unroll 4
        for (int o = 0; o < OC; ++o) {
          const V weight = hn::Set(d, w[o]);
#pragma GCC unroll 4
          for (int p = 0; p < P; ++p) acc[o][p] = hn::MulAdd(weight, pixels[p], acc[o][p]);
        }
      }
    }
  }

  const int width = job.out->width();
#pragma GCC unroll 4
  for (int o = 0; o < OC; ++o) {
    const float* other = job.other ? job.other->row(job.y, oc0 + o) + x : nullptr;
    float* out = job.out->row(job.y, oc0 + o) + x;
#pragma GCC unroll 4
    for (int p = 0; p < P; ++p) {
      V v = ApplyEpilogue(job.epilogue, acc[o][p], other ? other + p * N : nullptr);
      const int left = width - (x + p * static_cast<int>(N));
      if (left < static_cast<int>(N)) v = hn::IfThenElseZero(hn::FirstN(d, left), v);
      hn::Store(v, d, out + p * N);
    }
  }
}

template <int OC, int P>
void ConvBlocks(const RowJob& job, int x) {
  for (int oc0 = 0; oc0 < job.weights->out_channels; oc0 += OC) ConvBlock<OC, P>(job, oc0, x);
}

template <int OC>
void ConvRow(const RowJob& job) {
  constexpr int N = hn::MaxLanes(D());
  const int width = job.out->width();
  int x = 0;
  for (; x + (kPixelVectors - 1) * N < width; x += kPixelVectors * N) {
    ConvBlocks<OC, kPixelVectors>(job, x);
  }
  for (; x < width; x += N) ConvBlocks<OC, 1>(job, x);
}

void Conv3x3Row(const ConvWeights& weights, const PaddedRows& in, int y, ConvEpilogue epilogue,
                const PaddedRows* other, PaddedRows* out) {
  const RowJob job = {&weights, &in, other, out, epilogue, y};
  if (ConvBlockSize(weights.out_channels) == 3) {
    ConvRow<3>(job);
  } else {
    ConvRow<4>(job);
  }
}

// One row, OC output channels and the three horizontal taps of one input row: acc[o][kx] += sum
// over x of v_out[o][x] in[x + kx - 1], lane by lane.
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

// `sums` holds a vector per weight, [out / OC][in][ky][OC][kx], then one per output channel.
template <int OC>
void WeightGradRow(const PaddedRows& in, const PaddedRows& v_out, int y, float* sums) {
  const D d;
  constexpr int N = hn::MaxLanes(d);
  const int width = v_out.width();
  for (int oc0 = 0; oc0 < v_out.channels(); oc0 += OC) {
    const float* v = v_out.row(y, oc0);
    for (int c = 0; c < in.channels(); ++c) {
      for (int ky = 0; ky < 3; ++ky, sums += OC * 3 * N) {
        WeightGradTaps<OC>(v, v_out.stride(), in.row(y + ky - 1, c), width, sums);
      }
    }
  }
  for (int o = 0; o < v_out.channels(); ++o, sums += N) {
    const float* v = v_out.row(y, o);
    V acc = hn::Load(d, sums);
    for (int x = 0; x < width; x += N) acc = hn::Add(acc, hn::Load(d, v + x));
    hn::Store(acc, d, sums);
  }
}

template <int OC>
void WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y0, int y1, float* sums,
                    float* v_w, float* v_bias) {
  const D d;
  constexpr int N = hn::MaxLanes(d);
  const int in_channels = in.channels(), out_channels = v_out.channels();
  const size_t count = size_t(out_channels) * (in_channels * 9 + 1);
  std::fill_n(sums, count * N, 0.0f);
  for (int y = y0; y < y1; ++y) WeightGradRow<OC>(in, v_out, y, sums);

  auto next_sum = [&] {
    const float total = hn::GetLane(hn::SumOfLanes(d, hn::Load(d, sums)));
    sums += N;
    return total;
  };
  for (int oc0 = 0; oc0 < out_channels; oc0 += OC) {
    for (int c = 0; c < in_channels; ++c) {
      for (int ky = 0; ky < 3; ++ky) {
        for (int o = oc0; o < oc0 + OC; ++o) {
          float* taps = v_w + (size_t(o) * in_channels + c) * 9 + 3 * ky;
          for (int kx = 0; kx < 3; ++kx) taps[kx] = next_sum();
        }
      }
    }
  }
  for (int o = 0; o < out_channels; ++o) v_bias[o] = next_sum();
}

void Conv3x3WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y0, int y1,
                           float* scratch, float* v_w, float* v_bias) {
  if (ConvBlockSize(v_out.channels()) == 3) {
    WeightGradRows<3>(in, v_out, y0, y1, scratch, v_w, v_bias);
  } else {
    WeightGradRows<4>(in, v_out, y0, y1, scratch, v_w, v_bias);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(Conv3x3Row);
HWY_EXPORT(Conv3x3WeightGradRows);

// Calls place(out, in, tap, index) for every packed weight.
template <typename Place>
void ForEachPacked(int in_channels, int out_channels, Place place) {
  const int block = ConvBlockSize(out_channels);
  size_t index = 0;
  for (int o0 = 0; o0 < out_channels; o0 += block) {
    for (int c = 0; c < in_channels; ++c) {
      for (int tap = 0; tap < 9; ++tap) {
        for (int o = o0; o < o0 + block; ++o) place(o, c, tap, index++);
      }
    }
  }
}

void Allocate(int in, int out, ConvWeights* weights) {
  if (in != weights->in_channels || out != weights->out_channels) {
    weights->in_channels = in;
    weights->out_channels = out;
    weights->w = hwy::AllocateAligned<float>(size_t(in) * out * 9);
    weights->bias = hwy::AllocateAligned<float>(out);
  }
  std::fill_n(weights->bias.get(), out, 0.0f);
}

}  // namespace

void ConvWeights::Pack(int in, int out, const float* source, const float* source_bias) {
  Allocate(ConvPaddedChannels(in), ConvPaddedChannels(out), this);
  ForEachPacked(in_channels, out_channels, [&](int o, int c, int tap, size_t index) {
    w[index] = o < out && c < in ? source[(size_t(o) * in + c) * 9 + tap] : 0.0f;
  });
  std::copy_n(source_bias, out, bias.get());
}

void ConvWeights::PackTransposed(int in, int out, const float* source) {
  Allocate(ConvPaddedChannels(out), ConvPaddedChannels(in), this);
  ForEachPacked(in_channels, out_channels, [&](int o, int c, int tap, size_t index) {
    w[index] = o < in && c < out ? source[(size_t(c) * in + o) * 9 + 8 - tap] : 0.0f;
  });
}

void Conv3x3Row(const ConvWeights& weights, const PaddedRows& in, int y, ConvEpilogue epilogue,
                const PaddedRows* other, PaddedRows* out) {
  HWY_DYNAMIC_DISPATCH(Conv3x3Row)(weights, in, y, epilogue, other, out);
}

size_t ConvWeightGradScratch(int in_channels, int out_channels) {
  return PaddedRows::kPad * out_channels * (in_channels * 9 + 1);
}

void Conv3x3WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y0, int y1,
                           float* scratch, float* v_w, float* v_bias) {
  HWY_DYNAMIC_DISPATCH(Conv3x3WeightGradRows)(in, v_out, y0, y1, scratch, v_w, v_bias);
}

}  // namespace litags
#endif  // HWY_ONCE
