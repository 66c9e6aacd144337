#ifndef LITAGS_SERVER_JOBS_TRANSITION_H_
#define LITAGS_SERVER_JOBS_TRANSITION_H_

#include <cstdint>
#include <string_view>

#include "absl/status/status.h"
#include "server/jobs/codec.h"
#include "server/jobs/state_machine.h"
#include "server/store/job_store.h"

namespace litags {

// Applies an action to a job inside its transaction: checks it, sets the new state and the times
// that belong to it, and writes an event if the state is another one. `error` is set for kFail.
//
// A finished scene, and its report, stay until a better one is finished: a job that was resumed for
// more iterations, and then fails or is cancelled, has the scene again that it had before.
absl::Status ApplyAction(JobTransaction& job, JobAction action, int64_t now_ms,
                         std::string_view message, const JobError* error = nullptr);

// When a job that is in `state` since `end_ms` is removed, as its creator wanted; 0: never.
absl::StatusOr<int64_t> ExpiryOf(const JobRecord& job, JobState state, int64_t end_ms);

// Of what workers write into one job's log.
inline constexpr int64_t kMaxJobLogBytes = int64_t{1} << 20;
// Changes of a job's state are told in a full log, too, up to so many bytes in all.
inline constexpr int64_t kMaxJobLogBytesWithStates = kMaxJobLogBytes + (int64_t{64} << 10);

// Writes the event, and the entry of the log, of a state that was reached by creation.
absl::Status AddStateEvent(JobTransaction& job, int64_t now_ms, std::string_view message,
                           const JobError* error = nullptr);

// Notes that blobs of the job may be there that no row names, for a sweep.
absl::Status NoteUnreferencedBlobsOf(ClientStore& store, std::string_view id);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_TRANSITION_H_
