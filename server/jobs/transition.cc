#include "server/jobs/transition.h"

#include <algorithm>

#include "engine/core/error.h"

namespace litags {

namespace {

// Jobs that have ended are kept as long as their creator wanted.
absl::StatusOr<int64_t> ExpiryOf(const JobRecord& job, JobState state, int64_t now_ms) {
  if (!IsTerminal(state) || job.policy.empty()) return 0;
  LITAGS_ASSIGN_OR_RETURN(const auto policy, Decode<JobPolicy>(job.policy));
  if (policy.retention_seconds == 0) return 0;
  return now_ms + static_cast<int64_t>(1000 * policy.retention_seconds);
}

}  // namespace

absl::Status AddStateEvent(JobTransaction& job, int64_t now_ms, std::string_view message,
                           const JobError* error) {
  StateChange change{job.job.state, std::string(message), std::nullopt};
  if (error) change.error = *error;
  return job.AddEvent({0, now_ms, EventKind::kState, Encode(change)});
}

absl::Status ApplyAction(JobTransaction& job, JobAction action, int64_t now_ms,
                         std::string_view message, const JobError* error) {
  JobRecord& record = job.job;
  LITAGS_ASSIGN_OR_RETURN(const JobState next, NextState(record.state, action));
  if (next == record.state) return absl::OkStatus();
  const bool was_running = record.state == JobState::kRunning;
  record.state = next;
  record.error = error ? Encode(*error) : "";
  record.end_time_ms = IsTerminal(next) ? now_ms : 0;
  LITAGS_ASSIGN_OR_RETURN(record.expire_time_ms, ExpiryOf(record, next, now_ms));
  // A job that lost its worker keeps its place in the queue.
  if (next == JobState::kQueued && action != JobAction::kRequeue) record.queue_time_ms = now_ms;
  if (next == JobState::kRunning) {
    if (record.start_time_ms == 0) record.start_time_ms = now_ms;
    record.lease_start_ms = now_ms;
  } else {
    // A clock that was set back must not lengthen the job's time.
    if (was_running) record.run_ms += std::max<int64_t>(0, now_ms - record.lease_start_ms);
    record.lease_owner.clear();
    record.cancel_requested = false;
  }
  return AddStateEvent(job, now_ms, message, error);
}

}  // namespace litags
