// Jobs as workers see them. A lease is the right to run one job and to write about it; whoever
// lost it can write nothing more.
#ifndef LITAGS_SERVER_JOBS_LEASES_H_
#define LITAGS_SERVER_JOBS_LEASES_H_

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/jobs.h"
#include "server/jobs/transition.h"
#include "server/store/job_store.h"

namespace litags {

struct LeaseOptions {
  int64_t duration_ms = 10000;  // without a heartbeat for this long, the job goes to another worker
  // After this many lost workers the job fails, counted since its user started or resumed it.
  int max_attempts = 3;
  int64_t max_log_bytes = kMaxJobLogBytes;
  // Of all pictures that show a job's progress: some hundreds. Later progress comes without one.
  int64_t max_preview_bytes = int64_t{256} << 20;
};

// A worker's hold on a job.
struct Lease {
  std::string owner;  // the worker's name, unique among all workers there ever were
  JobRecord job;      // as it was when leased
};

// Thread-safe. Every call with a Lease but NoteUnreferencedBlobs() fails with ABORTED (LEASE_LOST)
// if the job was given to another worker, ended or deleted.
class Leases {
 public:
  // The stores must outlive this. Without a clock, the store's and AwakeClockMs() are used.
  // `awake_ms`: a clock that nobody sets, and that stands still while the machine sleeps; nullptr:
  // `clock` is such a clock.
  Leases(JobStore* store, BlobStore* blobs, LeaseOptions options = {}, Clock clock = nullptr,
         Clock awake_ms = nullptr);

  // Takes the first queued job that fits a worker which has that; nullopt if there is none.
  // TakeBackLost() first.
  absl::StatusOr<std::optional<Lease>> Acquire(const std::string& owner, const Resources& has = {});

  // Ends the leases of workers that are not heard of any more: as WorkerDied(). Not before
  // everybody had the time to renew theirs: since this was made, the store was away, the machine
  // slept or the clock was set. Without such leases, two reads.
  absl::Status TakeBackLost();

  // Keeps the lease. `ran_ms`: for how long the engine has run under it, by the worker's own clock,
  // which stands still while the machine sleeps. Returns whether the job is to be cancelled.
  absl::StatusOr<bool> Heartbeat(const Lease& lease, int64_t ran_ms);
  // The same without keeping it: only reads.
  absl::StatusOr<bool> CancelRequested(const Lease& lease);

  absl::Status AddProgress(const Lease& lease, const Progress& progress);
  // Of what does not fit any more, an entry tells. What programs say need not be text: what is not
  // UTF-8, or NUL, becomes U+FFFD, here and in Fail().
  absl::Status AddLog(const Lease& lease, const std::vector<LogEntry>& entries);
  // The engine's files are these from now on; with an iteration, the scene among them is a new
  // snapshot. Said again, this and progress change nothing: after a commit of which nobody knows,
  // they can be.
  absl::Status Keep(const Lease& lease, const KeptFiles& files,
                    std::optional<int> snapshot_iteration);

  // The ends of a lease. There is no success without a scene: INTERNAL (SCENE_MISSING).
  absl::Status Succeed(const Lease& lease, const ReconstructReport& report, const KeptFiles& files);
  absl::Status Fail(const Lease& lease, const absl::Status& error);
  absl::Status Stopped(const Lease& lease);  // cancelled, as asked for
  // The job waits for another worker, and this attempt does not count. `why` is for humans.
  absl::Status GiveBack(const Lease& lease, int64_t ran_ms, std::string_view why = kShutDown);

  // The lease was lost after blobs were stored under it: they are looked for when the job has
  // ended.
  absl::Status NoteUnreferencedBlobs(const Lease& lease);

  // A worker is known to be dead: what it held goes back into the queue, or FAILED after too many
  // attempts, or CANCELLED if that was asked for. `why` is for humans: "killed by signal 9".
  absl::Status WorkerDied(std::string_view owner, std::string_view why);
  // The same of one that was told to end: what it held waits for another one, and the attempt does
  // not count.
  absl::Status WorkerStopped(std::string_view owner);

 private:
  static constexpr std::string_view kShutDown =
      "the worker shut down; the job goes on with the next one";

  absl::StatusOr<JobRecord> Update(const Lease& lease, JobStore::Change change);
  absl::Status AddToLog(JobTransaction& job, const std::vector<LogEntry>& entries);
  absl::StatusOr<bool> HasRoomFor(const Lease& lease, int64_t preview_bytes);
  // `end` of each job that a worker which is gone held.
  absl::Status EndLeasesOf(std::string_view owner, const JobStore::Change& end);
  absl::Status Abandon(JobTransaction& job, std::string_view why);
  absl::Status Return(JobTransaction& job, std::string_view why);
  // No lease ends later than one taken now. Where one does, the clock was set back since, and a
  // dead worker would keep its job until the old time came again. A living one renews in time.
  absl::Status ShortenImpossibleLeases();
  absl::Status AbandonStale();
  // The time since which others can have renewed their leases, as far as is known here.
  int64_t RenewableSinceMs();

  JobStore* const store_;
  BlobStore* const blobs_;
  const LeaseOptions options_;
  const Clock clock_, awake_ms_;
  std::mutex mutex_;
  int64_t ahead_ms_ = 0;    // of clock_ before awake_ms_, when that was looked at last
  int64_t watched_ms_ = 0;  // the time since which the two have gone together
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_LEASES_H_
