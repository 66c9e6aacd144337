// What this process has used of the machine.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_PROCESS_USAGE_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_PROCESS_USAGE_H_

#include <cstdint>

namespace litags {

// Largest resident set since this program was started (VmHWM), bytes; 0 where /proc does not say.
// Unlike getrusage's ru_maxrss it does not begin with that of the process that started it.
int64_t PeakRssBytes();

// Processor time of all threads, user and system, seconds.
double CpuSeconds();

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_PROCESS_USAGE_H_
