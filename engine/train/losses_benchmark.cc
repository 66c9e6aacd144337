// Time of each loss at the size of a LOM photo. Argument: threads.
#include <benchmark/benchmark.h>

#include "engine/core/rng.h"
#include "engine/train/depth_loss.h"
#include "engine/train/losses.h"

namespace litags {
namespace {

constexpr int kWidth = 500, kHeight = 375;

Planes Random(int channels, uint64_t stream) {
  Planes planes(channels, kHeight, kWidth);
  const CounterRng rng(1, stream);
  for (size_t i = 0; i < planes.data.size(); ++i) planes.data[i] = rng.Uniform(i);
  return planes;
}

struct Fixture {
  explicit Fixture(const benchmark::State& state) : ws(static_cast<int>(state.range(0))) {}
  LossWorkspace ws;
  Planes x = Random(3, 1), y = Random(3, 2), l = Random(3, 3), a = Random(1, 4), b = Random(1, 5);
  Planes v_x{3, kHeight, kWidth}, v_l{3, kHeight, kWidth}, v_a{1, kHeight, kWidth};
};

void UnpackImage(benchmark::State& state) {
  Fixture f(state);
  const Photo photo = PhotoFromU8(ToImageU8(f.x));
  for (auto _ : state) litags::UnpackImage(photo, f.ws, &f.y);
}

void L1(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) benchmark::DoNotOptimize(L1Loss(f.x, f.y, 1, f.v_x, f.ws));
}

void L1Weighted(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) benchmark::DoNotOptimize(L1Loss(f.x, f.y, 1, f.v_x, f.ws, f.a));
}

void Mse(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) benchmark::DoNotOptimize(MseLoss(f.x, f.y, 1, f.v_x, f.v_l, f.ws));
}

void Tv(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) {
    benchmark::DoNotOptimize(TvLoss(f.x, TvNorm::kSquared, 1, f.v_x, f.ws));
  }
}

void Reconstruction(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) benchmark::DoNotOptimize(ReconstructionLoss(f.x, f.y, 1, f.v_x, f.ws));
}

void ProductReconstruction(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) {
    benchmark::DoNotOptimize(ProductReconstructionLoss(f.x, f.l, f.y, 1, f.v_x, f.v_l, f.ws));
  }
}

void Depth(benchmark::State& state) {
  Fixture f(state);
  uint64_t iteration = 0;
  for (auto _ : state) {
    const auto patches = DrawDepthPatches(kWidth, kHeight, 1, iteration++);
    benchmark::DoNotOptimize(DepthLoss(f.a, f.b, {}, patches, 1, f.v_a, f.ws).Sum());
  }
}

void Prior(benchmark::State& state) {
  Fixture f(state);
  for (auto _ : state) benchmark::DoNotOptimize(L1Loss(f.a, f.b, 1, f.v_a, f.ws));
}

#define LITAGS_LOSS_BENCHMARK(name) \
  BENCHMARK(name)->Arg(1)->Arg(2)->ArgName("threads")->UseRealTime()->Unit(benchmark::kMillisecond)

LITAGS_LOSS_BENCHMARK(UnpackImage);
LITAGS_LOSS_BENCHMARK(L1);
LITAGS_LOSS_BENCHMARK(L1Weighted);
LITAGS_LOSS_BENCHMARK(Mse);
LITAGS_LOSS_BENCHMARK(Tv);
LITAGS_LOSS_BENCHMARK(Reconstruction);
LITAGS_LOSS_BENCHMARK(ProductReconstruction);
LITAGS_LOSS_BENCHMARK(Depth);
LITAGS_LOSS_BENCHMARK(Prior);

}  // namespace
}  // namespace litags

BENCHMARK_MAIN();
