// The life of a job: every transition, once.
#ifndef LITAGS_SERVER_JOBS_STATE_MACHINE_H_
#define LITAGS_SERVER_JOBS_STATE_MACHINE_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "server/store/job_store.h"

namespace litags {

// What can be done to a job: by its owner, or by the worker that runs it.
enum class JobAction {
  kUpload,   // store a file; one that failed for its files takes others
  kStart,    // hand it to the workers
  kCancel,   // ask for a stop
  kResume,   // try again, or go on
  kExtend,   // go on for more iterations than it had
  kRemove,   // delete it
  kLease,    // a worker takes it
  kReport,   // its worker reports progress
  kSucceed,  // its worker is done
  kFail,     // its worker, or the lack of one, ends it with an error
  kStop,     // its worker obeys kCancel
  kRequeue,  // its worker is gone or is shutting down
};

inline constexpr JobState kAllJobStates[] = {JobState::kUploading, JobState::kQueued,
                                             JobState::kRunning,   JobState::kSucceeded,
                                             JobState::kFailed,    JobState::kCancelled};

std::string_view JobStateName(JobState state);  // "UPLOADING", ...

// SUCCEEDED, FAILED, CANCELLED.
bool IsTerminal(JobState state);

// The state after an action. A running job that is to be cancelled stays RUNNING until its worker
// stops. FAILED_PRECONDITION if the state does not allow the action, with a reason per action:
// JOB_NOT_UPLOADING, JOB_ALREADY_DONE, JOB_NOT_RESUMABLE, JOB_RUNNING, JOB_NOT_QUEUED,
// JOB_NOT_RUNNING; the message says what would.
absl::StatusOr<JobState> NextState(JobState state, JobAction action);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_STATE_MACHINE_H_
