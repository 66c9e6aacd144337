#ifndef LITAGS_SERVER_API_THREAD_POOL_H_
#define LITAGS_SERVER_API_THREAD_POOL_H_

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "absl/status/status.h"

namespace litags {

// Threads for work that may block or take long, which gRPC's own threads must not do. Everything
// submitted is run, also when the pool is destroyed, since each task ends some call.
class ThreadPool {
 public:
  // Try() accepts up to `max_waiting` tasks that no thread has begun, and answers `busy` beyond.
  ThreadPool(int threads, size_t max_waiting, absl::Status busy);
  ~ThreadPool() { Stop(); }

  absl::Status Try(std::function<void()> task);
  // For the next step of a call that was let in by Try(): never refused.
  void Run(std::function<void()> task);
  // Returns when everything submitted has run; nothing may be submitted any more.
  void Stop();

 private:
  void Loop();

  const size_t max_waiting_;
  const absl::Status busy_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> tasks_;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_THREAD_POOL_H_
