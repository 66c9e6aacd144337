// How long a loop of tasks takes on so many threads, as ParallelFor() deals them out.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_LOOP_SPAN_H_
#define LITAGS_ENGINE_TOOLS_BENCH_LOOP_SPAN_H_

#include <algorithm>
#include <cstddef>
#include <vector>

namespace litags {

// Milliseconds from the loop's start to its last task's end: every thread does its share of
// consecutive tasks from the front, then those of the next threads from the back.
inline double LoopSpanMs(const std::vector<double>& tasks_ms, int threads) {
  struct Share {
    size_t begin, end;
  };
  std::vector<Share> shares;
  for (int i = 0; i < threads; ++i) {
    shares.push_back({tasks_ms.size() * i / threads, tasks_ms.size() * (i + 1) / threads});
  }
  std::vector<double> free_at(threads);
  for (size_t left = tasks_ms.size(); left > 0; --left) {
    const size_t thread = std::min_element(free_at.begin(), free_at.end()) - free_at.begin();
    size_t of = thread;
    while (shares[of].begin == shares[of].end) of = (of + 1) % threads;
    const size_t task = of == thread ? shares[of].begin++ : --shares[of].end;
    free_at[thread] += tasks_ms[task];
  }
  return *std::max_element(free_at.begin(), free_at.end());
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_LOOP_SPAN_H_
