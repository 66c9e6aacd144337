#include <cmath>

#include "engine/core/rng.h"
#include "engine/denoise/pdm.h"

namespace litags {
namespace {

void FillHeNormal(const CounterRng& rng, int fan_in, float* w, size_t count) {
  const double stddev = std::sqrt(2.0 / fan_in);
  for (size_t i = 0; i < count; ++i) w[i] = static_cast<float>(stddev * rng.Normal(i));
}

}  // namespace

PdmNetLayout::PdmNetLayout(int hidden) {
  const size_t h = hidden;
  w1 = 0;
  b1 = w1 + h * 3 * 9;
  w2 = b1 + h;
  b2 = w2 + h * h * 9;
  w3 = b2 + h;
  b3 = w3 + 3 * h * 9;
  size = b3 + 3;
}

PdmWeights PdmWeights::Zeros(const PdmOptions& options) {
  PdmWeights weights;
  weights.hidden = options.hidden;
  const size_t size = PdmNetLayout(options.hidden).size;
  weights.nets.assign(options.shared ? 1 : options.stages, std::vector<float>(size, 0.0f));
  return weights;
}

PdmWeights PdmWeights::Initial(const PdmOptions& options, uint64_t seed) {
  PdmWeights weights = Zeros(options);
  const PdmNetLayout layout(options.hidden);
  for (size_t k = 0; k < weights.nets.size(); ++k) {
    float* net = weights.nets[k].data();
    FillHeNormal(CounterRng(seed, 2 * k), 3 * 9, net + layout.w1, layout.b1 - layout.w1);
    FillHeNormal(CounterRng(seed, 2 * k + 1), options.hidden * 9, net + layout.w2,
                 layout.b2 - layout.w2);
  }
  return weights;
}

}  // namespace litags
