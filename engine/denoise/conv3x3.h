// 3x3 convolution kernels for few channels: SIMD lanes run along pixels, a
// register block of output channels and pixels is accumulated in one go.
// Source: plain correlation with zero padding, stride 1; weights
// [out,in,ky,kx]. Along y they use the minimal filtering F(4,3) (Lavin and
// Gray, "Fast Algorithms for Convolutional Neural Networks"): out = A^T ((G w)
// * (B d)) makes 4 rows of output from 6 of input with half of the
// multiplications; its adjoint gives the weight gradient.
#ifndef LITAGS_ENGINE_DENOISE_CONV3X3_H_
#define LITAGS_ENGINE_DENOISE_CONV3X3_H_

#include <cstddef>

#include "engine/denoise/padded_rows.h"
#include "hwy/aligned_allocator.h"

namespace litags {

// Output channels per register block: 3 for images, else 4 (counts are padded
// to a multiple).
constexpr int ConvBlockSize(int out_channels) { return out_channels == 3 ? 3 : 4; }
constexpr int ConvPaddedChannels(int channels) {
  const int block = ConvBlockSize(channels);
  return (channels + block - 1) / block * block;
}

constexpr int kConvRows = 4;         // rows of output per call
constexpr int kConvTransformed = 6;  // rows of input they see

// Transformed weights G w in the order in which the kernel reads them:
// [out / block][kConvTransformed][in][kx][block]; channels that exist only as
// padding have zero weights and bias, so they stay zero.
struct ConvWeights {
  int in_channels = 0;   // padded
  int out_channels = 0;  // padded
  hwy::AlignedFreeUniquePtr<float[]> w, bias;

  // From w [out,in,3,3] and bias [out].
  void Pack(int in, int out, const float* w, const float* bias);
  // The convolution of the input gradient: channels swapped, kernels turned by
  // 180 degrees, no bias.
  void PackTransposed(int in, int out, const float* w);
};

enum class ConvEpilogue {
  kRelu,      // out = max(conv, 0)
  kReluVjp,   // out = other > 0 ? conv : 0 (ReLU'(0) = 0)
  kSubtract,  // out = conv - other
  kResidual,  // out = base - (other - conv)
};

// One convolution of an image. `other` and `base` have the shape of `out`; null where the epilogue
// does not read them.
struct ConvLayer {
  const ConvWeights* weights;
  const PaddedRows* in;
  ConvEpilogue epilogue;
  PaddedRows* out;
  const PaddedRows* other = nullptr;
  const PaddedRows* base = nullptr;
  // Not null on the way back: `in` is the gradient of a convolution of `activation`, whose weights'
  // gradient is wanted, too.
  const PaddedRows* activation = nullptr;
};

// Floats of scratch that Conv3x3Rows needs; aligned to a vector.
size_t ConvScratch(const PaddedRows& in);

// Writes rows y .. y + kConvRows - 1 of the layer, as far as there are any; they depend on the rows
// y - 1 .. y + kConvRows of its input.
void Conv3x3Rows(const ConvLayer& layer, int y, float* scratch);

// Floats of scratch and of sums that Conv3x3WeightGradRows needs; aligned to a vector.
size_t ConvWeightGradScratch(const PaddedRows& in, const PaddedRows& v_out);
size_t ConvWeightGradSums(int in_channels, int out_channels);

// Adds what rows y .. y + kConvRows - 1 of v_out (as far as there are any) bring to the gradient of
// the weights and bias of a convolution of `in`. `sums` start as zeros.
void Conv3x3WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y, float* scratch,
                           float* sums);

// The gradient from such sums: v_w in the unpacked order [out,in,ky,kx] of the padded channel
// counts, v_bias [out].
void Conv3x3WeightGradOfSums(int in_channels, int out_channels, const float* sums, float* v_w,
                             float* v_bias);

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_CONV3X3_H_
