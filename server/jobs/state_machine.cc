#include "server/jobs/state_machine.h"

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"

namespace litags {
namespace {

struct Transition {
  JobAction action;
  JobState from;
  JobState to;
};

constexpr Transition kTransitions[] = {
    {JobAction::kUpload, JobState::kUploading, JobState::kUploading},
    {JobAction::kUpload, JobState::kFailed, JobState::kUploading},

    {JobAction::kStart, JobState::kUploading, JobState::kQueued},

    {JobAction::kCancel, JobState::kUploading, JobState::kCancelled},
    {JobAction::kCancel, JobState::kQueued, JobState::kCancelled},
    {JobAction::kCancel, JobState::kRunning, JobState::kRunning},
    {JobAction::kCancel, JobState::kCancelled, JobState::kCancelled},

    {JobAction::kResume, JobState::kFailed, JobState::kQueued},
    {JobAction::kResume, JobState::kCancelled, JobState::kQueued},

    {JobAction::kExtend, JobState::kFailed, JobState::kQueued},
    {JobAction::kExtend, JobState::kCancelled, JobState::kQueued},
    {JobAction::kExtend, JobState::kSucceeded, JobState::kQueued},

    {JobAction::kRemove, JobState::kUploading, JobState::kUploading},
    {JobAction::kRemove, JobState::kQueued, JobState::kQueued},
    {JobAction::kRemove, JobState::kSucceeded, JobState::kSucceeded},
    {JobAction::kRemove, JobState::kFailed, JobState::kFailed},
    {JobAction::kRemove, JobState::kCancelled, JobState::kCancelled},

    {JobAction::kLease, JobState::kQueued, JobState::kRunning},

    {JobAction::kReport, JobState::kRunning, JobState::kRunning},
    {JobAction::kSucceed, JobState::kRunning, JobState::kSucceeded},
    {JobAction::kFail, JobState::kRunning, JobState::kFailed},
    {JobAction::kStop, JobState::kRunning, JobState::kCancelled},
    {JobAction::kRequeue, JobState::kRunning, JobState::kQueued},
};

struct Refusal {
  const char* reason;
  const char* message;  // continues "the job is STATE; "
};

Refusal RefusalOf(JobAction action) {
  switch (action) {
    case JobAction::kUpload:
      return {"JOB_NOT_UPLOADING",
              "files can only be added before StartJob, and to a FAILED job; create a new one"};
    case JobAction::kStart:
      return {"JOB_NOT_UPLOADING",
              "only a job that is UPLOADING can be started; a FAILED or CANCELLED one is resumed"};
    case JobAction::kCancel:
      return {"JOB_ALREADY_DONE", "there is nothing to cancel"};
    case JobAction::kResume:
    case JobAction::kExtend:
      return {"JOB_NOT_RESUMABLE",
              "only a FAILED or CANCELLED job can be resumed, and a SUCCEEDED one with more "
              "iterations"};
    case JobAction::kRemove:
      return {"JOB_RUNNING", "cancel it before deleting it"};
    case JobAction::kLease:
      return {"JOB_NOT_QUEUED", "only a QUEUED job can be taken by a worker"};
    case JobAction::kReport:
    case JobAction::kSucceed:
    case JobAction::kFail:
    case JobAction::kStop:
    case JobAction::kRequeue:
      return {"JOB_NOT_RUNNING", "no worker has it"};
  }
  LITAGS_CHECK(false);
}

}  // namespace

std::string_view JobStateName(JobState state) {
  switch (state) {
    case JobState::kUploading:
      return "UPLOADING";
    case JobState::kQueued:
      return "QUEUED";
    case JobState::kRunning:
      return "RUNNING";
    case JobState::kSucceeded:
      return "SUCCEEDED";
    case JobState::kFailed:
      return "FAILED";
    case JobState::kCancelled:
      return "CANCELLED";
  }
  LITAGS_CHECK(false);
}

bool IsTerminal(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed ||
         state == JobState::kCancelled;
}

absl::StatusOr<JobState> NextState(JobState state, JobAction action) {
  for (const Transition& t : kTransitions) {
    if (t.action == action && t.from == state) return t.to;
  }
  const Refusal refusal = RefusalOf(action);
  return MakeError(
      absl::StatusCode::kFailedPrecondition, refusal.reason, "name",
      absl::StrCat("the job is ", std::string(JobStateName(state)), "; ", refusal.message));
}

}  // namespace litags
