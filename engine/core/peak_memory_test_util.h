// What a piece of work takes of memory.
#ifndef LITAGS_ENGINE_CORE_PEAK_MEMORY_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_PEAK_MEMORY_TEST_UTIL_H_

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "absl/functional/function_ref.h"

namespace litags {

// A line of /proc/self/status, bytes.
inline int64_t OfThisProcess(const std::string& key) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(key)) return std::stoll(line.substr(key.size() + 1)) * 1024;
  }
  return 0;
}

// Bytes that `work` takes at its peak; none where the system cannot say.
inline std::optional<int64_t> PeakMemoryOf(absl::FunctionRef<void()> work) {
  std::ofstream("/proc/self/clear_refs") << 5;  // VmHWM begins anew
  const int64_t before = OfThisProcess("VmRSS");
  if (OfThisProcess("VmHWM") > before + (1 << 20)) return std::nullopt;
  work();
  return OfThisProcess("VmHWM") - before;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_PEAK_MEMORY_TEST_UTIL_H_
