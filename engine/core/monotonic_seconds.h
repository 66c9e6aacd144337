#ifndef LITAGS_ENGINE_CORE_MONOTONIC_SECONDS_H_
#define LITAGS_ENGINE_CORE_MONOTONIC_SECONDS_H_

#include <chrono>

namespace litags {

// Of the clock that never goes back; only differences mean something.
inline double MonotonicSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_MONOTONIC_SECONDS_H_
