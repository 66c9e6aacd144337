#include "server/jobs/transition.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"

namespace litags {
namespace {

absl::StatusOr<KeptFiles> KeptOf(const JobRecord& job) {
  return job.kept.empty() ? KeptFiles() : Decode<KeptFiles>(job.kept);
}

// A finished scene goes on to be trained.
absl::Status SetFinishedAside(JobRecord* job) {
  LITAGS_ASSIGN_OR_RETURN(KeptFiles kept, KeptOf(*job));
  const auto scene = kept.find(kSceneFile);
  if (scene == kept.end()) return absl::OkStatus();
  kept[kFinishedScene] = scene->second;
  SetKept(job, kept);
  return absl::OkStatus();
}

absl::Status DropFinished(JobRecord* job) {
  LITAGS_ASSIGN_OR_RETURN(KeptFiles kept, KeptOf(*job));
  if (kept.erase(kFinishedScene) > 0) SetKept(job, kept);
  return absl::OkStatus();
}

// The training went no further. `note` gets what the user should know.
absl::Status BringFinishedBack(JobTransaction& job, int64_t now_ms, std::string* note) {
  LITAGS_ASSIGN_OR_RETURN(KeptFiles kept, KeptOf(job.job));
  const auto finished = kept.find(kFinishedScene);
  if (finished == kept.end()) return absl::OkStatus();
  kept[kSceneFile] = finished->second;
  SetKept(&job.job, kept);
  job.job.has_unreferenced_blobs = true;
  ReconstructReport report;
  if (!job.job.report.empty()) {
    LITAGS_ASSIGN_OR_RETURN(report, Decode<ReconstructReport>(job.job.report));
  }
  *note =
      absl::StrCat("; its finished scene of ", Counted(report.iterations, "iteration"), " stays");
  if (job.job.snapshot_iteration == report.iterations) return absl::OkStatus();
  job.job.snapshot_iteration = report.iterations;
  return job.AddEvent({0, now_ms, EventKind::kSnapshot, Encode(SnapshotRecord{report.iterations})});
}

// Other files will come: what was made of the old ones is of no use.
void ForgetRuns(JobRecord* job) {
  job->kept.clear();
  job->kept_bytes = 0;
  job->progress.clear();
  job->report.clear();
  job->snapshot_iteration = -1;
  job->start_request_id.clear();  // the same call is now one for other files
  job->has_unreferenced_blobs = true;
}

}  // namespace

absl::StatusOr<int64_t> ExpiryOf(const JobRecord& job, JobState state, int64_t end_ms) {
  if (!IsTerminal(state)) return 0;
  LITAGS_ASSIGN_OR_RETURN(const JobPolicy policy, PolicyOf(job));
  if (policy.retention_seconds == 0) return 0;
  return end_ms + static_cast<int64_t>(1000 * policy.retention_seconds);
}

absl::Status AddStateEvent(JobTransaction& job, int64_t now_ms, std::string_view message,
                           const JobError* error) {
  const std::string text(message);
  if (job.job.log_bytes < kMaxJobLogBytesWithStates) {
    LITAGS_RETURN_IF_ERROR(job.AddLog(
        {0, now_ms, error ? LogSeverity::kError : LogSeverity::kInfo,
         absl::StrCat(std::string(JobStateName(job.job.state)), text.empty() ? "" : ": ", text)}));
  }
  StateChange change{job.job.state, text, std::nullopt};
  if (error) change.error = *error;
  return job.AddEvent({0, now_ms, EventKind::kState, Encode(change)});
}

absl::Status NoteUnreferencedBlobsOf(ClientStore& store, std::string_view id) {
  const auto note = [](JobTransaction& job) {
    job.job.has_unreferenced_blobs = true;
    return absl::OkStatus();
  };
  return store.Update(id, note).status();
}

absl::Status ApplyAction(JobTransaction& job, JobAction action, int64_t now_ms,
                         std::string_view message, const JobError* error) {
  JobRecord& record = job.job;
  LITAGS_ASSIGN_OR_RETURN(const JobState next, NextState(record.state, action));
  if (next == record.state) return absl::OkStatus();
  std::string note;
  if (record.state == JobState::kSucceeded) LITAGS_RETURN_IF_ERROR(SetFinishedAside(&record));
  if (next == JobState::kSucceeded) LITAGS_RETURN_IF_ERROR(DropFinished(&record));
  if (next == JobState::kFailed || next == JobState::kCancelled) {
    LITAGS_RETURN_IF_ERROR(BringFinishedBack(job, now_ms, &note));
  }
  if (next == JobState::kUploading) ForgetRuns(&record);
  record.state = next;
  if (IsTerminal(next) && !record.webhook.empty()) {
    LITAGS_ASSIGN_OR_RETURN(Webhook webhook, WebhookOf(record));
    webhook.attempts = 0;
    webhook.last_error.clear();
    record.webhook = Encode(webhook);
    record.webhook_due_ms = now_ms;
  }
  record.error = error ? Encode(*error) : "";
  record.end_time_ms = IsTerminal(next) ? now_ms : 0;
  LITAGS_ASSIGN_OR_RETURN(record.expire_time_ms, ExpiryOf(record, next, now_ms));
  // A job that lost its worker keeps its place in the queue.
  if (next == JobState::kQueued && action != JobAction::kRequeue) record.queue_time_ms = now_ms;
  if (next == JobState::kRunning) {
    if (record.start_time_ms == 0) record.start_time_ms = now_ms;
    record.lease_start_ms = now_ms;
  } else {
    record.lease_owner.clear();
    record.cancel_requested = false;
  }
  return AddStateEvent(job, now_ms, absl::StrCat(std::string(message), note), error);
}

}  // namespace litags
