#ifndef LITAGS_SERVER_API_STALL_TIMER_H_
#define LITAGS_SERVER_API_STALL_TIMER_H_

#include <grpcpp/alarm.h>

#include <functional>
#include <memory>
#include <mutex>

namespace litags {

// Tells when one step of a call takes too long. Not thread-safe, but `on_stall` comes from another
// thread.
class StallTimer {
 public:
  ~StallTimer() { Stop(); }

  // Calls `on_stall` once unless Stop() comes first. It must be quick and must not use this timer.
  void Start(double seconds, std::function<void()> on_stall);
  // Whether `on_stall` was called; it will not be any more, and has returned.
  bool Stop();

 private:
  // Alarms outlive the call, hence shared.
  struct Wait {
    std::mutex mutex;  // also held by whoever calls `on_stall`
    bool over = false, stalled = false;
  };

  std::shared_ptr<Wait> wait_;  // null before the first
  std::unique_ptr<grpc::Alarm> alarm_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_STALL_TIMER_H_
