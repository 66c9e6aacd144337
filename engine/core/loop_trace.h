// How long each task of a program's loops takes, so that loops on more threads than a machine has
// can be worked out. For measurements only.
#ifndef LITAGS_ENGINE_CORE_LOOP_TRACE_H_
#define LITAGS_ENGINE_CORE_LOOP_TRACE_H_

#include <vector>

#include "absl/functional/function_ref.h"

namespace litags {

// One ParallelFor(), its tasks run one after the other.
struct LoopTrace {
  const char* file;  // of the call
  int line;
  double before_ms = 0;          // on the calling thread, since the loop before
  std::vector<double> tasks_ms;  // by task
};

struct Trace {
  std::vector<LoopTrace> loops;
  double after_ms = 0;  // since the last loop
};

// Runs body. Loops for several threads that it starts on this thread run on this thread alone, as
// thread 0.
Trace TraceLoops(absl::FunctionRef<void()> body);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_LOOP_TRACE_H_
