#ifndef LITAGS_SERVER_API_THREAD_POOL_H_
#define LITAGS_SERVER_API_THREAD_POOL_H_

#include <climits>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"

namespace litags {

// Threads for work that may block or take long, which gRPC's own threads must not do. Clients take
// turns, and so do a client's new calls and the next steps of its open ones; where tasks take long,
// some threads are left for others. Everything submitted is run, also when the pool is destroyed,
// since each task ends some call.
class ThreadPool {
 public:
  // Try() accepts up to `max_waiting` tasks of a client that no thread has begun, and answers
  // `busy` beyond. Of one client, at most `max_running` tasks run at the same time.
  ThreadPool(int threads, size_t max_waiting, absl::Status busy, int max_running = INT_MAX);
  ~ThreadPool() { Stop(); }

  absl::Status Try(const std::string& client, std::function<void()> task);
  // For the next step of a call that was let in: never refused, and not counted by Try().
  void Run(const std::string& client, std::function<void()> task);
  // Returns when everything submitted has run; nothing may be submitted any more.
  void Stop();

 private:
  using Tasks = std::deque<std::function<void()>>;
  // By client, steps apart; none is empty.
  using Queues = std::map<std::pair<std::string, bool>, Tasks>;

  // Under mutex_.
  void Add(const std::string& client, bool is_step, std::function<void()> task);
  // The first in turn whose client may run one more; end(): there is none.
  std::deque<Queues::iterator>::iterator NextTurn();
  std::function<void()> Take(std::deque<Queues::iterator>::iterator turn);
  void Loop();

  const size_t max_waiting_;
  const absl::Status busy_;
  const int max_running_;
  std::mutex mutex_;
  std::condition_variable wake_;
  Queues queues_;
  std::deque<Queues::iterator> turns_;  // each of queues_ once, the next in front
  std::map<std::string, int> running_;  // tasks by client; none is 0
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_THREAD_POOL_H_
