#include "engine/core/parallel.h"

#include <algorithm>

// ThreadSanitizer cannot see into libgomp and would report its barriers as races; the same
// loops then run on plain threads.
#if defined(__SANITIZE_THREAD__)
#include <atomic>
#include <thread>
#include <vector>
#else
#include <omp.h>
#endif

namespace litags {

int DefaultThreadCount() {
#if defined(__SANITIZE_THREAD__)
  return std::max(1u, std::thread::hardware_concurrency());
#else
  return std::max(1, omp_get_num_procs());
#endif
}

void ParallelFor(int threads, size_t num_tasks,
                 absl::FunctionRef<void(size_t task, int thread)> body) {
  if (threads <= 0) threads = DefaultThreadCount();
  threads = static_cast<int>(std::min<size_t>(threads, num_tasks));
  if (threads <= 1) {
    for (size_t i = 0; i < num_tasks; ++i) body(i, 0);
    return;
  }
#if defined(__SANITIZE_THREAD__)
  std::atomic<size_t> next{0};
  auto run = [&](int thread) {
    for (size_t i = next++; i < num_tasks; i = next++) body(i, thread);
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads; ++i) pool.emplace_back(run, i);
  run(0);
  for (std::thread& t : pool) t.join();
#else
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
  for (size_t i = 0; i < num_tasks; ++i) body(i, omp_get_thread_num());
#endif
}

}  // namespace litags
