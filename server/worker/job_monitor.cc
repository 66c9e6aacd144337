#include "server/worker/job_monitor.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/store/file_error.h"
#include "server/worker/memory.h"

namespace litags {
JobMonitor::JobMonitor(const Lease& lease, const WorkerContext& context,
                       const WorkerOptions& options, CancelToken shutdown,
                       CancelToken engine_cancel)
    : lease_(lease),
      context_(context),
      options_(options),
      shutdown_(std::move(shutdown)),
      engine_cancel_(std::move(engine_cancel)),
      policy_(PolicyOf(lease.job).value_or(JobPolicy())),
      max_memory_bytes_(policy_.max_memory_bytes > 0
                            ? policy_.max_memory_bytes
                            : options.has.memory_bytes - options.has.memory_bytes / 8),
      last_heartbeat_(MonotonicSeconds()),
      thread_([this] { Loop(); }) {}

JobMonitor::~JobMonitor() { Finish(); }

int64_t JobMonitor::ran_ms() const {
  if (!engine_began_) return 0;
  const double until = engine_ended_ ? end_ : MonotonicSeconds();
  return static_cast<int64_t>((until - start_) * 1000);
}

JobMonitor::StopReason JobMonitor::Finish() {
  {
    std::lock_guard lock(mutex_);
    finished_ = true;
    wake_.notify_one();
  }
  if (thread_.joinable()) thread_.join();
  return stop_reason_;
}

void JobMonitor::Loop() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, std::chrono::duration<double>(options_.poll_seconds),
                     [this] { return finished_; });
      if (finished_) return;
    }
    Check();
  }
}

void JobMonitor::Check() {
  if (lease_lost_) StopEngine(StopReason::kLeaseLost);
  if (shutdown_.IsCancelled()) StopEngine(StopReason::kShutdown);
  if (stop_reason_ != StopReason::kNone && !engine_ended_) GiveUpIfStuck();
  if (stop_reason_ == StopReason::kLeaseLost) return;
  // Before the store is asked: it may be away for hours.
  if (stop_reason_ == StopReason::kNone && engine_began_ && !engine_ended_) {
    limit_exceeded_ = CheckLimits();
    if (!limit_exceeded_.ok()) StopEngine(StopReason::kLimit);
  }
  const bool renew = MonotonicSeconds() - last_heartbeat_ >= options_.heartbeat_seconds;
  const auto cancel = renew ? context_.leases->Heartbeat(lease_, ran_ms())
                            : context_.leases->CancelRequested(lease_);
  if (absl::IsAborted(cancel.status())) return StopEngine(StopReason::kLeaseLost);
  if (!cancel.ok()) {
    // The store may come back; if it does not, the lease runs out and the next call says so.
    if (!store_is_away_) {
      spdlog::warn("job={} cannot renew the lease: {}", lease_.job.id,
                   MessageWithReason(cancel.status()));
    }
    store_is_away_ = true;
    return;
  }
  if (store_is_away_) spdlog::info("job={} can renew the lease again", lease_.job.id);
  store_is_away_ = false;
  if (renew) last_heartbeat_ = MonotonicSeconds();
  if (*cancel) StopEngine(StopReason::kCancelled);
}

absl::Status JobMonitor::CheckLimits() const {
  const double seconds = static_cast<double>(lease_.job.run_ms + ran_ms()) / 1000;
  if (policy_.max_run_seconds > 0 && seconds > policy_.max_run_seconds) {
    return MakeError(absl::StatusCode::kDeadlineExceeded, "RUN_TIME_EXCEEDED",
                     "policy.max_run_time",
                     absl::StrCat("the job ran for ", policy_.max_run_seconds,
                                  " s, which is its limit; ResumeJob goes on from the last "
                                  "checkpoint for as long again"));
  }
  if (max_memory_bytes_ == 0) return absl::OkStatus();
  const int64_t bytes = ResidentBytesWithChildren();
  if (bytes <= max_memory_bytes_) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kResourceExhausted, "MEMORY_EXCEEDED", "policy.max_memory_bytes",
      absl::StrCat("the job held ", bytes, " bytes of memory; its limit is ", max_memory_bytes_,
                   "; set max_image_side or max_gaussians lower, or the limit higher"));
}

void JobMonitor::StopEngine(StopReason reason) {
  if (stop_reason_ != StopReason::kNone) return;
  stop_reason_ = reason;
  stop_time_ = MonotonicSeconds();
  engine_cancel_.Cancel();
}

void JobMonitor::GiveUpIfStuck() {
  // A file that is being fetched may be large. Only a worker that is to end cannot wait for it.
  if (!engine_began_ && !shutdown_.IsCancelled()) return;
  if (MonotonicSeconds() - stop_time_ < options_.grace_seconds || !options_.give_up) return;
  spdlog::error("job={} {} does not stop; leaving it", lease_.job.id,
                engine_began_ ? "the engine" : "the fetching of its files");
  absl::Status status;
  if (stop_reason_ == StopReason::kCancelled) status = context_.leases->Stopped(lease_);
  if (stop_reason_ == StopReason::kLimit) status = context_.leases->Fail(lease_, limit_exceeded_);
  if (stop_reason_ == StopReason::kShutdown) status = context_.leases->GiveBack(lease_, ran_ms());
  if (!status.ok()) spdlog::error("job={} {}", lease_.job.id, MessageWithReason(status));
  options_.give_up();
}

}  // namespace litags
