// Repeated timing with medians, and the JSON that goes with it.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_TIMING_H_
#define LITAGS_ENGINE_TOOLS_BENCH_TIMING_H_

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/core/monotonic_seconds.h"

namespace litags {

struct Timing {
  double median_ms = 0, min_ms = 0, max_ms = 0;
};

inline double NowMs() { return MonotonicSeconds() * 1e3; }

inline Timing Summarize(std::vector<double> ms) {
  std::sort(ms.begin(), ms.end());
  return {ms[ms.size() / 2], ms.front(), ms.back()};
}

// Runs body twice to warm up, then `repetitions` times.
template <class Body>
Timing Measure(int repetitions, Body body) {
  for (int i = 0; i < 2; ++i) body();
  std::vector<double> ms;
  for (int i = 0; i < repetitions; ++i) {
    const double start = NowMs();
    body();
    ms.push_back(NowMs() - start);
  }
  return Summarize(std::move(ms));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_TIMING_H_
