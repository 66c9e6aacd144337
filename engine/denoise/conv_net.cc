#include "engine/denoise/conv_net.h"

#include <algorithm>

#include "engine/core/parallel.h"
#include "engine/denoise/pdm.h"

namespace litags {
namespace {

// Rows per task. Fixed, because the sums over strips are part of the result.
constexpr int kStripRows = 16;
static_assert(kStripRows % kConvRows == 0);

// Bands of groups of kConvRows rows: long enough that their seams do not meet, few enough that most
// work is inside them.
constexpr int kBandGroups = 8;
constexpr int kMaxBands = 8;

int NumStrips(int height) { return (height + kStripRows - 1) / kStripRows; }

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

  Convolve(threads, {{&conv3_transposed_, &v_out, ConvEpilogue::kReluVjp, &v_h2_, &act.h2},
                     {&conv2_transposed_, &v_h2_, ConvEpilogue::kReluVjp, &v_h1_, &act.h1},
                     {&conv1_transposed_, &v_h1_, ConvEpilogue::kSubtract, v_in, &v_out}});
  WeightGradient(threads, hidden_, 3, act.h2, v_out, v_net + at.w3, v_net + at.b3);
  WeightGradient(threads, hidden_, hidden_, act.h1, v_h2_, v_net + at.w2, v_net + at.b2);
  WeightGradient(threads, 3, hidden_, act.in, v_h1_, v_net + at.w1, v_net + at.b1);
}

void ConvNet::ReserveScratch(int threads, size_t per_thread) {
  if (per_thread * threads <= scratch_size_) return;
  scratch_size_ = per_thread * threads;
  scratch_ = hwy::AllocateAligned<float>(scratch_size_);
}

// Layer l of a group of rows needs layer l - 1 of the groups beside it. Inside a band of groups all
// layers advance together, each one group behind the one before, so that a layer reads what has
// just been written. At the seams between bands each layer stops a group earlier than the one
// before it; what is left there is done when both bands are.
void ConvNet::Convolve(int threads, absl::Span<const ConvLayer> layers) {
  const int num_layers = static_cast<int>(layers.size());
  const int groups = (layers[0].in->height() + kConvRows - 1) / kConvRows;
  const int bands = std::clamp(groups / kBandGroups, 1, kMaxBands);
  size_t scratch = 0;
  for (const ConvLayer& layer : layers) scratch = std::max(scratch, ConvScratch(*layer.in));
  if (threads <= 0) threads = DefaultThreadCount();
  ReserveScratch(threads, scratch);
  const auto convolve = [&](int layer, int group, int thread) {
    Conv3x3Rows(layers[layer], group * kConvRows, scratch_.get() + thread * scratch);
  };
  const auto seam = [&](int band) { return groups * band / bands; };
  ParallelFor(threads, bands, [&](size_t task, int thread) {
    const int band = static_cast<int>(task);
    const int begin = seam(band), end = seam(band + 1);
    for (int step = begin; step < end + num_layers - 1; ++step) {
      for (int layer = 0; layer < num_layers; ++layer) {
        const int first = begin + (begin > 0 ? layer : 0);
        const int last = end - (end < groups ? layer : 0);
        const int group = step - layer;
        if (group >= first && group < last) convolve(layer, group, thread);
      }
    }
  });
  ParallelFor(threads, bands - 1, [&](size_t task, int thread) {
    const int middle = seam(static_cast<int>(task) + 1);
    for (int layer = 1; layer < num_layers; ++layer) {
      for (int group = middle - layer; group < middle + layer; ++group) {
        convolve(layer, group, thread);
      }
    }
  });
}

void ConvNet::WeightGradient(int threads, int in_channels, int out_channels, const PaddedRows& in,
                             const PaddedRows& v_out, float* v_w, float* v_bias) {
  const int height = in.height(), strips = NumStrips(height);
  const size_t num_weights = size_t(v_out.channels()) * in.channels() * 9;
  const size_t num_partial = num_weights + v_out.channels();
  const size_t scratch = ConvWeightGradScratch(in, v_out);
  if (threads <= 0) threads = DefaultThreadCount();
  partial_.resize(std::max(partial_.size(), num_partial * strips));
  ReserveScratch(threads, scratch);
  ParallelFor(threads, strips, [&](size_t strip, int thread) {
    const int y0 = static_cast<int>(strip) * kStripRows;
    float* sums = partial_.data() + strip * num_partial;
    Conv3x3WeightGradRows(in, v_out, y0, std::min(y0 + kStripRows, height),
                          scratch_.get() + thread * scratch, sums, sums + num_weights);
  });

  auto total = [&](size_t index) {
    double sum = 0;
    for (int strip = 0; strip < strips; ++strip) sum += partial_[strip * num_partial + index];
    return static_cast<float>(sum);
  };
  for (int o = 0; o < out_channels; ++o) {
    for (int c = 0; c < in_channels; ++c) {
      for (int tap = 0; tap < 9; ++tap) {
        v_w[(size_t(o) * in_channels + c) * 9 + tap] +=
            total((size_t(o) * in.channels() + c) * 9 + tap);
      }
    }
    v_bias[o] += total(num_weights + o);
  }
}

}  // namespace litags
