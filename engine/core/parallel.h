// Threads: one place that knows how loops are spread over cores. Results never depend on the
// number of threads, because every task writes its own output and reductions run in task order.
#ifndef LITAGS_ENGINE_CORE_PARALLEL_H_
#define LITAGS_ENGINE_CORE_PARALLEL_H_

#include <cstddef>

#include "absl/functional/function_ref.h"

namespace litags {

// Cores this process may use, found out once: MachineCores().
int DefaultThreadCount();

// Calls body(task, thread) for every task in [0, num_tasks), on up to `threads` threads
// (<= 0: DefaultThreadCount()); `thread` is in [0, threads). Fewer than 2^32 tasks. Every thread
// starts with a share of consecutive tasks, in order, and then takes the last ones of others'
// shares: tasks side by side, which often write the same cache lines, seldom run at the same time,
// and a thread finds in its cache what it wrote in the loop before. Loops of several calling
// threads run side by side; a loop inside a loop runs on its own thread. When a task throws, no
// further ones begin, and the first exception is thrown to the caller once those at work have
// ended. TraceLoops() names a loop by the place of its call (std::source_location is not in clang
// 14).
void ParallelFor(int threads, size_t num_tasks,
                 absl::FunctionRef<void(size_t task, int thread)> body,
                 const char* file = __builtin_FILE(), int line = __builtin_LINE());

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_PARALLEL_H_
