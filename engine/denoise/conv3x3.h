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
};

// Floats of scratch that Conv3x3Rows needs; aligned to a vector.
size_t ConvScratch(const PaddedRows& in);

// Writes rows y .. y + kConvRows - 1 of the layer, as far as there are any; they depend on the rows
// y - 1 .. y + kConvRows of its input.
void Conv3x3Rows(const ConvLayer& layer, int y, float* scratch);

// Floats of scratch that Conv3x3WeightGradRows needs; aligned to a vector.
size_t ConvWeightGradScratch(const PaddedRows& in, const PaddedRows& v_out);

// Adds up, over rows [y0, y1), the gradient of the weights, in the unpacked
// order [out,in,ky,kx] of the padded channel counts, and of the bias [out]. y1
// - y0 is a multiple of kConvRows or y1 = H.
void Conv3x3WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y0, int y1,
                           float* scratch, float* v_w, float* v_bias);

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_CONV3X3_H_
