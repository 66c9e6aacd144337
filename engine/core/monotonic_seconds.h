#ifndef LITAGS_ENGINE_CORE_MONOTONIC_SECONDS_H_
#define LITAGS_ENGINE_CORE_MONOTONIC_SECONDS_H_

#include <chrono>

namespace litags {

// Of the clock that never goes back; only differences mean something.
inline double MonotonicSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Adds the time until its end to a sum, seconds.
class Timer {
 public:
  explicit Timer(double* sum) : sum_(sum) {}
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;
  ~Timer() { *sum_ += MonotonicSeconds() - start_; }

 private:
  double* const sum_;
  const double start_ = MonotonicSeconds();
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_MONOTONIC_SECONDS_H_
