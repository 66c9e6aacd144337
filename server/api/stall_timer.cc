#include "server/api/stall_timer.h"

#include <chrono>
#include <utility>

namespace litags {

void StallTimer::Start(double seconds, std::function<void()> on_stall) {
  Stop();
  const auto wait = wait_ = std::make_shared<Wait>();
  std::lock_guard lock(wait->mutex);  // or `on_stall` could come before the alarm is kept
  const auto deadline = std::chrono::system_clock::now() +
                        std::chrono::milliseconds(static_cast<int64_t>(1000 * seconds));
  alarm_ = std::make_unique<grpc::Alarm>();
  alarm_->Set(deadline, [wait, on_stall = std::move(on_stall)](bool due) {
    if (!due) return;
    std::lock_guard lock(wait->mutex);
    if (wait->over) return;
    wait->over = wait->stalled = true;
    on_stall();
  });
}

bool StallTimer::Stop() {
  if (!wait_) return false;
  alarm_.reset();
  std::lock_guard lock(wait_->mutex);
  wait_->over = true;
  return wait_->stalled;
}

}  // namespace litags
