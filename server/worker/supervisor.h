#ifndef LITAGS_SERVER_WORKER_SUPERVISOR_H_
#define LITAGS_SERVER_WORKER_SUPERVISOR_H_

#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/cancel.h"
#include "server/jobs/leases.h"

namespace litags {

struct SupervisorOptions {
  std::vector<std::string> command;  // program and arguments; "--name NAME" is added
  std::vector<std::string> env;  // "NAME=value", for what must not be seen in a list of processes
  int workers = 1;
  int niceness = 0;                  // added to ours, 0..19
  double min_backoff_seconds = 0.2;  // before the first restart; doubles while workers die young
  double max_backoff_seconds = 10;
  double young_seconds = 30;         // after one that lived longer, the pause is the least again
  double grace_seconds = 8;          // between SIGTERM and SIGKILL when shutting down
  std::function<void()> on_restart;  // a worker ended by itself; may be empty; in any thread
};

// Keeps local workers running as child processes. A worker that dies loses its job at once, back
// into the queue, and is replaced; when this process dies, the kernel kills the workers.
class Supervisor {
 public:
  // `leases` must outlive this.
  Supervisor(SupervisorOptions options, Leases* leases);
  ~Supervisor();  // Stop()

  // Whether there are workers, and each of them died young again and again. Thread-safe.
  bool AllFailing() const;

  // Tells the workers to end; they give their jobs back first.
  void BeginStop() { stop_.Cancel(); }
  // The same, and waits until they have.
  void Stop();

 private:
  using SteadyClock = std::chrono::steady_clock;

  // What becomes of the workers at one place, one after the other.
  struct Place {
    SteadyClock::time_point start;  // of the newest one
    int young_deaths = 0;           // in a row
  };

  void KeepRunning(int index);

  const SupervisorOptions options_;
  Leases* const leases_;
  CancelToken stop_;
  mutable std::mutex mutex_;
  std::vector<Place> places_;
  std::vector<std::thread> threads_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_SUPERVISOR_H_
