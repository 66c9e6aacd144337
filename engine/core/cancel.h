#ifndef LITAGS_ENGINE_CORE_CANCEL_H_
#define LITAGS_ENGINE_CORE_CANCEL_H_

#include <atomic>
#include <memory>

#include "absl/status/status.h"

namespace litags {

// A flag that one side raises and long work polls. Copies share the flag. Thread-safe.
class CancelToken {
 public:
  CancelToken() : flag_(std::make_shared<std::atomic<bool>>(false)) {}

  void Cancel() { flag_->store(true, std::memory_order_relaxed); }
  bool IsCancelled() const { return flag_->load(std::memory_order_relaxed); }

  // CANCELLED once Cancel() was called, OK before.
  absl::Status Check() const {
    return IsCancelled() ? absl::CancelledError("cancelled on request") : absl::OkStatus();
  }

 private:
  std::shared_ptr<std::atomic<bool>> flag_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CANCEL_H_
