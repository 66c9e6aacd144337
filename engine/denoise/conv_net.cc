#include "engine/denoise/conv_net.h"

#include <algorithm>

#include "engine/core/parallel.h"
#include "engine/denoise/pdm.h"

namespace litags {
namespace {

// Bands of groups of kConvRows rows: long enough that their seams do not meet, few enough that most
// work is inside them. Fixed, because sums over bands are part of the result.
constexpr int kBandGroups = 8;
constexpr int kMaxBands = 8;

// Of the gradient of one layer's weights, channels padded.
size_t NumWeights(const ConvLayer& layer) {
  return size_t(layer.in->channels()) * layer.activation->channels() * 9;
}
size_t GradientSize(const ConvLayer& layer) {
  return layer.activation ? NumWeights(layer) + layer.in->channels() : 0;
}
size_t SumsSize(const ConvLayer& layer) {
  return layer.activation ? ConvWeightGradSums(layer.activation->channels(), layer.in->channels())
                          : 0;
}

}  // namespace

void ConvNetActivations::Resize(int hidden, int height, int width) {
  in.Resize(3, height, width);
  h1.Resize(ConvPaddedChannels(hidden), height, width);
  h2.Resize(ConvPaddedChannels(hidden), height, width);
}

void ConvNet::SetWeights(const float* net) {
  const PdmNetLayout at(hidden_);
  conv1_.Pack(3, hidden_, net + at.w1, net + at.b1);
  conv2_.Pack(hidden_, hidden_, net + at.w2, net + at.b2);
  conv3_.Pack(hidden_, 3, net + at.w3, net + at.b3);
  conv1_transposed_.PackTransposed(3, hidden_, net + at.w1);
  conv2_transposed_.PackTransposed(hidden_, hidden_, net + at.w2);
  conv3_transposed_.PackTransposed(hidden_, 3, net + at.w3);
}

void ConvNet::Forward(int threads, ConvNetActivations* act, const PaddedRows& base,
                      PaddedRows* out) {
  Convolve(threads, {{&conv1_, &act->in, ConvEpilogue::kRelu, &act->h1},
                     {&conv2_, &act->h1, ConvEpilogue::kRelu, &act->h2},
                     {&conv3_, &act->h2, ConvEpilogue::kResidual, out, &act->in, &base}});
}

void ConvNet::Backward(int threads, const ConvNetActivations& act, const PaddedRows& v_out,
                       PaddedRows* v_in, float* v_net) {
  const PdmNetLayout at(hidden_);
  const int height = v_out.height(), width = v_out.width();
  v_h1_.Resize(ConvPaddedChannels(hidden_), height, width);
  v_h2_.Resize(ConvPaddedChannels(hidden_), height, width);

  const ConvLayer layers[] = {
      {&conv3_transposed_, &v_out, ConvEpilogue::kReluVjp, &v_h2_, &act.h2, nullptr, &act.h2},
      {&conv2_transposed_, &v_h2_, ConvEpilogue::kReluVjp, &v_h1_, &act.h1, nullptr, &act.h1},
      {&conv1_transposed_, &v_h1_, ConvEpilogue::kSubtract, v_in, &v_out, nullptr, &act.in}};
  Convolve(threads, layers);
  const float* gradient = partial_.data();
  AddGradient(layers[0], hidden_, 3, gradient, v_net + at.w3, v_net + at.b3);
  gradient += GradientSize(layers[0]);
  AddGradient(layers[1], hidden_, hidden_, gradient, v_net + at.w2, v_net + at.b2);
  gradient += GradientSize(layers[1]);
  AddGradient(layers[2], 3, hidden_, gradient, v_net + at.w1, v_net + at.b1);
}

void ConvNet::Reserve(int threads, int partials, absl::Span<const ConvLayer> layers) {
  work_size_ = sums_size_ = gradient_size_ = 0;
  for (const ConvLayer& layer : layers) {
    work_size_ =
        std::max(work_size_, layer.activation ? ConvWeightGradScratch(*layer.activation, *layer.in)
                                              : ConvScratch(*layer.in));
    sums_size_ += SumsSize(layer);
    gradient_size_ += GradientSize(layer);
  }
  num_partials_ = partials;
  partial_.resize(num_partials_ * gradient_size_);
  const size_t scratch = threads * (work_size_ + sums_size_);
  if (scratch <= scratch_size_) return;
  scratch_size_ = scratch;
  scratch_ = hwy::AllocateAligned<float>(scratch_size_);
}

float* ConvNet::StartPart(int thread) {
  float* scratch = scratch_.get() + thread * (work_size_ + sums_size_);
  std::fill_n(scratch + work_size_, sums_size_, 0.0f);
  return scratch;
}

void ConvNet::ConvolveGroup(absl::Span<const ConvLayer> layers, int index, int group,
                            float* scratch) const {
  const ConvLayer& layer = layers[index];
  Conv3x3Rows(layer, group * kConvRows, scratch);
  if (layer.activation == nullptr) return;
  float* sums = scratch + work_size_;
  for (int i = 0; i < index; ++i) sums += SumsSize(layers[i]);
  Conv3x3WeightGradRows(*layer.activation, *layer.in, group * kConvRows, scratch, sums);
}

void ConvNet::EndPart(absl::Span<const ConvLayer> layers, int partial, const float* scratch) {
  const float* sums = scratch + work_size_;
  float* gradient = partial_.data() + partial * gradient_size_;
  for (const ConvLayer& layer : layers) {
    if (layer.activation == nullptr) continue;
    Conv3x3WeightGradOfSums(layer.activation->channels(), layer.in->channels(), sums, gradient,
                            gradient + NumWeights(layer));
    sums += SumsSize(layer);
    gradient += GradientSize(layer);
  }
}

// Layer l of a group of rows needs layer l - 1 of the groups beside it. Inside a band of groups all
// layers advance together, each one group behind the one before, so that a layer reads what has
// just been written. At the seams between bands each layer stops a group earlier than the one
// before it; what is left there is done when both bands are. Gradients of weights go to partial_,
// one set for each band and each seam.
void ConvNet::Convolve(int threads, absl::Span<const ConvLayer> layers) {
  const int num_layers = static_cast<int>(layers.size());
  const int groups = (layers[0].in->height() + kConvRows - 1) / kConvRows;
  const int bands = std::clamp(groups / kBandGroups, 1, kMaxBands);
  if (threads <= 0) threads = DefaultThreadCount();
  Reserve(threads, 2 * bands - 1, layers);

  const auto seam = [&](int band) { return groups * band / bands; };
  ParallelFor(threads, bands, [&](size_t index, int thread) {
    const int band = static_cast<int>(index), begin = seam(band), end = seam(band + 1);
    float* scratch = StartPart(thread);
    for (int step = begin; step < end + num_layers - 1; ++step) {
      for (int layer = 0; layer < num_layers; ++layer) {
        const int first = begin + (begin > 0 ? layer : 0);
        const int last = end - (end < groups ? layer : 0);
        const int group = step - layer;
        if (group >= first && group < last) ConvolveGroup(layers, layer, group, scratch);
      }
    }
    EndPart(layers, band, scratch);
  });
  ParallelFor(threads, bands - 1, [&](size_t index, int thread) {
    const int middle = seam(static_cast<int>(index) + 1);
    float* scratch = StartPart(thread);
    for (int layer = 1; layer < num_layers; ++layer) {
      for (int group = middle - layer; group < middle + layer; ++group) {
        ConvolveGroup(layers, layer, group, scratch);
      }
    }
    EndPart(layers, bands + static_cast<int>(index), scratch);
  });
}

void ConvNet::AddGradient(const ConvLayer& layer, int in_channels, int out_channels,
                          const float* gradient, float* v_w, float* v_bias) const {
  const auto total = [&](size_t index) {
    double sum = 0;
    for (int i = 0; i < num_partials_; ++i) sum += gradient[i * gradient_size_ + index];
    return static_cast<float>(sum);
  };
  const size_t padded_in = layer.activation->channels();
  for (int o = 0; o < out_channels; ++o) {
    for (int c = 0; c < in_channels; ++c) {
      for (int tap = 0; tap < 9; ++tap) {
        v_w[(size_t(o) * in_channels + c) * 9 + tap] += total((o * padded_in + c) * 9 + tap);
      }
    }
    v_bias[o] += total(NumWeights(layer) + o);
  }
}

}  // namespace litags
