#include "engine/tools/bench/machine.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/aligned.h"
#include "engine/core/parallel.h"
#include "engine/tools/bench/timing.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tools/bench/machine.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// `rounds` x 12 independent multiply-adds per lane: enough chains to hide the latency. Returns a
// value so that nothing is optimised away; *flops gets the floating-point operations done.
float FmaChains(int rounds, double* flops) {
  const hn::ScalableTag<float> d;
  const auto scale = hn::Set(d, 0.999f), add = hn::Set(d, 0.001f);
  // Different starts: equal chains would be merged by the compiler.
  const auto start = [&](int n) HWY_ATTR { return hn::Set(d, 1.0f + 0.01f * n); };
  auto a = start(0), b = start(1), c = start(2), e = start(3), f = start(4), g = start(5),
       h = start(6), i = start(7), j = start(8), k = start(9), l = start(10), m = start(11);
  for (int r = 0; r < rounds; ++r) {
    a = hn::MulAdd(a, scale, add), b = hn::MulAdd(b, scale, add), c = hn::MulAdd(c, scale, add);
    e = hn::MulAdd(e, scale, add), f = hn::MulAdd(f, scale, add), g = hn::MulAdd(g, scale, add);
    h = hn::MulAdd(h, scale, add), i = hn::MulAdd(i, scale, add), j = hn::MulAdd(j, scale, add);
    k = hn::MulAdd(k, scale, add), l = hn::MulAdd(l, scale, add), m = hn::MulAdd(m, scale, add);
  }
  *flops = 2.0 * 12 * rounds * hn::Lanes(d);
  const auto sum = hn::Add(
      hn::Add(hn::Add(a, b), hn::Add(c, e)),
      hn::Add(hn::Add(hn::Add(f, g), hn::Add(h, i)), hn::Add(hn::Add(j, k), hn::Add(l, m))));
  return hn::GetLane(sum);
}

// a = b + 2 c over n floats.
void Triad(const float* b, const float* c, float* a, size_t n) {
  const hn::ScalableTag<float> d;
  const auto two = hn::Set(d, 2.0f);
  for (size_t i = 0; i + hn::Lanes(d) <= n; i += hn::Lanes(d)) {
    hn::Store(hn::MulAdd(two, hn::Load(d, c + i), hn::Load(d, b + i)), d, a + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(FmaChains);
HWY_EXPORT(Triad);

absl::Status LimitInstructionSet(const std::string& name) {
  std::string known;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    if (name == hwy::TargetName(target)) {
      hwy::DisableTargets(target - 1);  // lower bits are wider vectors
      return absl::OkStatus();
    }
    absl::StrAppend(&known, known.empty() ? "" : ", ", hwy::TargetName(target));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("instruction set ", name, " is not there; this machine and build have ", known));
}

double PeakGflops(int threads) {
  std::vector<double> flops(threads);
  std::vector<float> sink(threads);
  const Timing t = Measure(7, [&] {
    ParallelFor(threads, threads, [&](size_t i, int) {
      sink[i] = HWY_DYNAMIC_DISPATCH(FmaChains)(4'000'000, &flops[i]);
    });
  });
  double total = 0;
  for (double f : flops) total += f;
  return total / t.min_ms / 1e6;
}

double TriadGbytes(int threads) {
  constexpr size_t kChunk = size_t{1} << 20;
  constexpr size_t kChunks = 32;
  AlignedFloats a(kChunk * kChunks), b(kChunk * kChunks, 1.0f), c(kChunk * kChunks, 2.0f);
  const Timing t = Measure(7, [&] {
    ParallelFor(threads, kChunks, [&](size_t i, int) {
      const size_t at = i * kChunk;
      HWY_DYNAMIC_DISPATCH(Triad)(b.data() + at, c.data() + at, a.data() + at, kChunk);
    });
  });
  return 3.0 * sizeof(float) * kChunk * kChunks / t.min_ms / 1e6;
}

}  // namespace litags
#endif  // HWY_ONCE
