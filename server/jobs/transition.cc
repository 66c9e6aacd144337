#include "server/jobs/transition.h"

#include "engine/core/error.h"

namespace litags {

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
  record.state = next;
  record.error = error ? Encode(*error) : "";
  record.end_time_ms = IsTerminal(next) ? now_ms : 0;
  record.expire_time_ms = 0;
  if (next == JobState::kQueued) record.queue_time_ms = now_ms;
  if (next == JobState::kRunning) {
    if (record.start_time_ms == 0) record.start_time_ms = now_ms;
  } else {
    record.lease_owner.clear();
    record.cancel_requested = false;
  }
  return AddStateEvent(job, now_ms, message, error);
}

}  // namespace litags
