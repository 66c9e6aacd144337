#ifndef LITAGS_SERVER_WORKER_JOB_MONITOR_H_
#define LITAGS_SERVER_WORKER_JOB_MONITOR_H_

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "engine/core/cancel.h"
#include "engine/core/monotonic_seconds.h"
#include "server/jobs/leases.h"
#include "server/worker/job_runner.h"

namespace litags {

// The thread beside a running engine that keeps the lease: renews it, and raises the engine's
// cancel token when the job is to be cancelled, the lease is lost, a limit is reached or the worker
// shuts down.
class JobMonitor {
 public:
  enum class StopReason { kNone, kCancelled, kShutdown, kLeaseLost, kLimit };

  // All arguments must outlive this.
  JobMonitor(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
             CancelToken shutdown, CancelToken engine_cancel);
  ~JobMonitor();

  // The lease is lost, as somebody else has found out.
  void NoteLeaseLost() { lease_lost_ = true; }
  // The engine is called: its time counts from now on. What comes before is the stores' time.
  void NoteEngineBegins() {
    start_ = MonotonicSeconds();
    engine_began_ = true;
  }
  // The engine has returned; the lease is kept for what is left to write.
  void NoteEngineEnded() {
    end_ = MonotonicSeconds();
    engine_ended_ = true;
  }
  // For how long the engine has run. The time of a machine that sleeps is not in it.
  int64_t ran_ms() const;

  // What the job may hold, 0: any.
  int64_t max_memory_bytes() const { return max_memory_bytes_; }

  // Ends the thread and says why the engine was stopped.
  StopReason Finish();
  // After Finish(): with kLimit, the error that the job ends with: DEADLINE_EXCEEDED
  // (RUN_TIME_EXCEEDED), RESOURCE_EXHAUSTED (MEMORY_EXCEEDED).
  const absl::Status& limit_exceeded() const { return limit_exceeded_; }

 private:
  void Loop();
  void Check();  // shutdown, limits, heartbeat, cancellation
  absl::Status CheckLimits() const;
  void StopEngine(StopReason reason);
  void GiveUpIfStuck();

  const Lease& lease_;
  const WorkerContext& context_;
  const WorkerOptions& options_;
  const CancelToken shutdown_;
  CancelToken engine_cancel_;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool finished_ = false;
  std::atomic<bool> lease_lost_ = false, engine_began_ = false, engine_ended_ = false;
  double start_ = 0, end_ = 0;  // seconds; set before engine_began_, engine_ended_

  // Used by the thread only.
  StopReason stop_reason_ = StopReason::kNone;
  absl::Status limit_exceeded_;
  bool store_is_away_ = false;  // said once
  JobPolicy policy_;
  // Of a job that sets no limit, 7/8 of what its worker has, lest the machine run out; 0: no limit.
  int64_t max_memory_bytes_ = 0;
  double stop_time_ = 0, last_heartbeat_ = 0;  // seconds

  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_JOB_MONITOR_H_
