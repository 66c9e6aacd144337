#ifndef LITAGS_SERVER_JOBS_SWEEP_MARK_H_
#define LITAGS_SERVER_JOBS_SWEEP_MARK_H_

#include <cstdint>

#include "server/store/job_store.h"

namespace litags {

// While a sweep removes uploaded blobs of an ended job, the job takes no files: one of them could
// have the digest of such a blob, and lose its bytes. The mark is a lease of the sweep, in columns
// that mean something to running jobs only. Each change of the state ends it, and time does, if the
// server of the sweep dies.
inline constexpr char kSweepMark[] = "(sweep) ";
inline constexpr int64_t kSweepMarkMs = 120'000;  // several times what one removal may take

inline bool IsBeingSwept(const JobRecord& job, int64_t now_ms) {
  // A clock that was set back does not make it longer.
  return job.state != JobState::kRunning && job.lease_owner.starts_with(kSweepMark) &&
         job.lease_expires_ms > now_ms && job.lease_expires_ms <= now_ms + kSweepMarkMs;
}

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_SWEEP_MARK_H_
