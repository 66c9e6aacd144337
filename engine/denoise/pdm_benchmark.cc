// Time of the PDM at 500x375, 3 stages. Run:
//   build/release/bin/pdm_benchmark --benchmark_repetitions=5
#include <benchmark/benchmark.h>

#include "engine/core/rng.h"
#include "engine/denoise/pdm.h"

namespace litags {
namespace {

constexpr int kHeight = 375, kWidth = 500;

// Multiply-adds of the convolutions, two operations each; filters and sums are left out.
double ForwardFlops(const PdmOptions& options) {
  const double per_pixel = 9.0 * options.hidden * (3 + options.hidden + 3);
  return 2.0 * per_pixel * options.stages * kHeight * kWidth;
}

struct Inputs {
  PdmOptions options;
  PdmWeights weights;
  Planes R0{3, kHeight, kWidth}, N{3, kHeight, kWidth}, v{3, kHeight, kWidth};

  explicit Inputs(int hidden) {
    options.hidden = hidden;
    weights = PdmWeights::Initial(options, 1);
    const CounterRng rng(1, 0);
    for (size_t i = 0; i < R0.data.size(); ++i) {
      R0.data[i] = static_cast<float>(rng.Uniform(3 * i));
      N.data[i] = static_cast<float>(0.1 * rng.Normal(3 * i + 1));
      v.data[i] = static_cast<float>(rng.Normal(3 * i + 2));
    }
    const PdmNetLayout at(options.hidden);
    float* w3 = weights.nets[0].data() + at.w3;
    for (size_t i = 0; i < at.b3 - at.w3; ++i) w3[i] = 0.1f * static_cast<float>(rng.Normal(i));
  }
};

void Forward(benchmark::State& state) {
  const Inputs in(static_cast<int>(state.range(1)));
  Pdm pdm(in.options, static_cast<int>(state.range(0)));
  pdm.Forward(in.weights, in.R0, in.N);  // allocates
  for (auto _ : state) pdm.Forward(in.weights, in.R0, in.N);
  state.counters["GFLOP/s"] = benchmark::Counter(ForwardFlops(in.options) * 1e-9,
                                                 benchmark::Counter::kIsIterationInvariantRate);
}

void Apply(benchmark::State& state) {
  const Inputs in(static_cast<int>(state.range(1)));
  Pdm pdm(in.options, static_cast<int>(state.range(0)));
  Planes R;
  pdm.Apply(in.weights, in.R0, in.N, &R);  // allocates
  for (auto _ : state) pdm.Apply(in.weights, in.R0, in.N, &R);
  state.counters["GFLOP/s"] = benchmark::Counter(ForwardFlops(in.options) * 1e-9,
                                                 benchmark::Counter::kIsIterationInvariantRate);
}

void Backward(benchmark::State& state) {
  const Inputs in(static_cast<int>(state.range(1)));
  Pdm pdm(in.options, static_cast<int>(state.range(0)));
  pdm.Forward(in.weights, in.R0, in.N);
  Planes v_R0 = in.v, v_N = in.v;
  PdmWeights v_weights;
  for (auto _ : state) pdm.Backward(in.v, in.v, v_R0, v_N, &v_weights);
  state.counters["GFLOP/s"] = benchmark::Counter(2 * ForwardFlops(in.options) * 1e-9,
                                                 benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK(Forward)
    ->ArgNames({"threads", "hidden"})
    ->ArgsProduct({{1, 2}, {8, 16}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(Apply)
    ->ArgNames({"threads", "hidden"})
    ->ArgsProduct({{1, 2}, {8, 16}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(Backward)
    ->ArgNames({"threads", "hidden"})
    ->ArgsProduct({{1, 2}, {8, 16}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace litags

BENCHMARK_MAIN();
