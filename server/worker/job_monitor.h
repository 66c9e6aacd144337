#ifndef LITAGS_SERVER_WORKER_JOB_MONITOR_H_
#define LITAGS_SERVER_WORKER_JOB_MONITOR_H_

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"
#include "server/jobs/leases.h"
#include "server/worker/job_runner.h"

namespace litags {

// The thread beside a running engine: renews the lease, writes what the engine reports, and raises
// the engine's cancel token when the job is to be cancelled, the lease is lost or the worker shuts
// down. The engine's calls only leave a note, so that training never waits for the store.
class JobMonitor : public ReconstructObserver {
 public:
  enum class StopReason { kNone, kCancelled, kShutdown, kLeaseLost, kLimit };

  // All arguments must outlive this.
  JobMonitor(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
             CancelToken shutdown, CancelToken engine_cancel);
  ~JobMonitor() override;

  void OnProgress(const Progress& progress) override;
  void OnSnapshot(const std::string& scene_path) override;

  // Ends the thread, writes what is still to be written, and says why the engine was stopped.
  StopReason Finish();
  // After Finish(): with kLimit, the error that the job ends with: DEADLINE_EXCEEDED
  // (RUN_TIME_EXCEEDED), RESOURCE_EXHAUSTED (MEMORY_EXCEEDED).
  const absl::Status& limit_exceeded() const { return limit_exceeded_; }

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Snapshot {
    std::string scene_path;
    int iteration;
  };

  void Loop();
  void Check();  // cancellation, shutdown, heartbeat, limits
  absl::Status CheckLimits() const;
  void WriteReports(bool all);
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
  bool urgent_ = false;               // a report that does not wait for progress_seconds
  std::optional<Progress> progress_;  // newest, not written yet
  std::optional<Snapshot> snapshot_;  // newest, not written yet
  std::optional<Stage> last_stage_;
  int iteration_ = 0;

  // Used by the thread only.
  StopReason stop_reason_ = StopReason::kNone;
  absl::Status limit_exceeded_;
  JobPolicy policy_;
  const TimePoint start_ = std::chrono::steady_clock::now();
  TimePoint stop_time_{}, last_heartbeat_{}, last_progress_{};

  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_JOB_MONITOR_H_
