// The network F of the PDM: three 3x3 convolutions joined by ReLU, and its VJP.
#ifndef LITAGS_ENGINE_DENOISE_CONV_NET_H_
#define LITAGS_ENGINE_DENOISE_CONV_NET_H_

#include <vector>

#include "absl/types/span.h"
#include "engine/denoise/conv3x3.h"
#include "engine/denoise/padded_rows.h"

namespace litags {

// Input and hidden activations (after ReLU) of one evaluation of F.
struct ConvNetActivations {
  PaddedRows in;      // 3
  PaddedRows h1, h2;  // hidden, padded

  void Resize(int hidden, int height, int width);
};

// One set of weights; they may be changed at any time by SetWeights. Keeps its
// scratch.
class ConvNet {
 public:
  explicit ConvNet(int hidden) : hidden_(hidden) {}

  // `net` as in PdmNetLayout.
  void SetWeights(const float* net);

  // LITA-GS Eq. 10: out [3] = base - (act->in - F(act->in)); fills act->h1, h2.
  void Forward(int threads, ConvNetActivations* act, const PaddedRows& base, PaddedRows* out);

  // VJP at `act`: v_in [3] = F^T(v_out) - v_out (the network is used as x -
  // F(x), up to sign) and v_net += gradient of the weights, laid out as in
  // PdmNetLayout.
  void Backward(int threads, const ConvNetActivations& act, const PaddedRows& v_out,
                PaddedRows* v_in, float* v_net);

 private:
  void Convolve(int threads, absl::Span<const ConvLayer> layers);
  // What Convolve does is cut in `partials` parts, each of which sums gradients for itself.
  void Reserve(int threads, int partials, absl::Span<const ConvLayer> layers);
  // The thread's scratch, with sums of zero.
  float* StartPart(int thread);
  // One group of rows of layers[index], and what it adds to the sums.
  void ConvolveGroup(absl::Span<const ConvLayer> layers, int index, int group,
                     float* scratch) const;
  // The gradients of the part's sums, to partial_.
  void EndPart(absl::Span<const ConvLayer> layers, int partial, const float* scratch);
  // Adds the gradient of the layer's weights, the sum of what Convolve left; `gradient` is its
  // place in the first of the partial ones.
  void AddGradient(const ConvLayer& layer, int in_channels, int out_channels, const float* gradient,
                   float* v_w, float* v_bias) const;

  int hidden_;
  ConvWeights conv1_, conv2_, conv3_;
  ConvWeights conv1_transposed_, conv2_transposed_, conv3_transposed_;
  PaddedRows v_h1_, v_h2_;
  std::vector<float> partial_;  // [num_partials][gradient_size: weights and biases of all layers]
  int num_partials_ = 0;
  size_t gradient_size_ = 0;
  hwy::AlignedFreeUniquePtr<float[]> scratch_;  // [threads][work_size and sums_size]
  size_t scratch_size_ = 0, work_size_ = 0, sums_size_ = 0;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_CONV_NET_H_
