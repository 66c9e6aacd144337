#ifndef LITAGS_ENGINE_CORE_CANCEL_H_
#define LITAGS_ENGINE_CORE_CANCEL_H_

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "absl/status/status.h"

namespace litags {

// A flag that one side raises and long work polls. Copies share the flag. Thread-safe.
class CancelToken {
 public:
  CancelToken() : flag_(std::make_shared<std::atomic<bool>>(false)) {}

  void Cancel() { flag_->store(true, std::memory_order_relaxed); }
  bool IsCancelled() const { return flag_->load(std::memory_order_relaxed); }

  // Sleeps for `seconds`, or until Cancel() is called, which ends the sleep within 20 ms.
  void SleepFor(double seconds) const {
    using Seconds = std::chrono::duration<double>;
    const auto end = std::chrono::steady_clock::now() + Seconds(seconds);
    for (Seconds left(seconds); left.count() > 0 && !IsCancelled();
         left = end - std::chrono::steady_clock::now()) {
      std::this_thread::sleep_for(std::min(left, Seconds(0.02)));
    }
  }

  // CANCELLED once Cancel() was called, OK before.
  absl::Status Check() const {
    return IsCancelled() ? absl::CancelledError("cancelled on request") : absl::OkStatus();
  }

 private:
  std::shared_ptr<std::atomic<bool>> flag_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CANCEL_H_
