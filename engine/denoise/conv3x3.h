// 3x3 convolution kernels for few channels: SIMD lanes run along pixels, a register block of
// output channels and pixels is accumulated in one go. Source: plain correlation with zero padding,
// stride 1; weights [out,in,ky,kx].
#ifndef LITAGS_ENGINE_DENOISE_CONV3X3_H_
#define LITAGS_ENGINE_DENOISE_CONV3X3_H_

#include <cstddef>

#include "engine/denoise/padded_rows.h"
#include "hwy/aligned_allocator.h"

namespace litags {

// Output channels per register block: 3 for images, else 4 (counts are padded to a multiple).
constexpr int ConvBlockSize(int out_channels) { return out_channels == 3 ? 3 : 4; }
constexpr int ConvPaddedChannels(int channels) {
  const int block = ConvBlockSize(channels);
  return (channels + block - 1) / block * block;
}

// Weights in the order in which the kernel reads them: [out / block][in][ky][kx][block]; channels
// that exist only as padding have zero weights and bias, so they stay zero.
struct ConvWeights {
  int in_channels = 0;   // padded
  int out_channels = 0;  // padded
  hwy::AlignedFreeUniquePtr<float[]> w, bias;

  // From w [out,in,3,3] and bias [out].
  void Pack(int in, int out, const float* w, const float* bias);
  // The convolution of the input gradient: channels swapped, kernels turned by 180 degrees, no
  // bias.
  void PackTransposed(int in, int out, const float* w);
};

enum class ConvEpilogue {
  kBias,      // out = conv
  kRelu,      // out = max(conv, 0)
  kReluVjp,   // out = other > 0 ? conv : 0 (ReLU'(0) = 0)
  kSubtract,  // out = conv - other
};

// Writes row y of `out` [out_channels]; `other` has the shape of `out` (last two epilogues).
void Conv3x3Row(const ConvWeights& weights, const PaddedRows& in, int y, ConvEpilogue epilogue,
                const PaddedRows* other, PaddedRows* out);

// Floats of scratch that Conv3x3WeightGradRows needs.
size_t ConvWeightGradScratch(int in_channels, int out_channels);

// Adds up, over rows [y0, y1), the gradient of the weights, in the unpacked order [out,in,ky,kx] of
// the padded channel counts, and of the bias [out].
void Conv3x3WeightGradRows(const PaddedRows& in, const PaddedRows& v_out, int y0, int y1,
                           float* scratch, float* v_w, float* v_bias);

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_CONV3X3_H_
