#ifndef LITAGS_SERVER_JOBS_SWEEPER_H_
#define LITAGS_SERVER_JOBS_SWEEPER_H_

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "server/jobs/uploads.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/installation_marker.h"
#include "server/store/job_store.h"

namespace litags {

// Removes what nobody will come back for: jobs whose time is over, and what crashes may leave:
// folders of deleted jobs, blobs that no job names, temporary files. Thread-safe.
class Sweeper {
 public:
  // All that is pointed to must outlive this. One per server, made at its start, of the jobs of all
  // clients. Without a clock, the store's is used. Without a marker, `blobs` is nobody else's for
  // sure. `awake_ms`: a clock that nobody sets, and that stands still while the machine sleeps;
  // nullptr: the other one is such a clock.
  Sweeper(JobStore* store, BlobStore* blobs, Uploads* uploads, DataDir data, Clock clock = nullptr,
          const InstallationMarker* marker = nullptr, Clock awake_ms = nullptr);

  // Returns the ids of the jobs that expired. Where something cannot be removed, the rest is, and
  // the first error is returned. Ends early when `stop` says so, and when a store is away.
  absl::StatusOr<std::vector<std::string>> Sweep(const CancelToken& stop = {});

 private:
  absl::Status RemoveAllExpired(const CancelToken& stop, std::vector<std::string>* expired);
  absl::Status RemoveExpired(const std::string& id, std::vector<std::string>* expired);
  void NoteTime();
  int64_t KeptAfterStartMs() const;
  int64_t LeastExpiry(const JobRecord& job) const;
  int64_t JumpedSinceEndMs(const JobRecord& job) const;
  absl::StatusOr<std::set<std::string>> JobFolders();
  absl::StatusOr<std::set<std::string>> JobsWithoutRow(const CancelToken& stop);
  bool OrphansAreOurs(size_t orphans);
  absl::Status RemoveOrphans(const CancelToken& stop);
  absl::Status RemoveOrphan(const std::string& id);
  absl::Status RemoveEndedUploads(const CancelToken& stop);
  absl::Status RemoveAllUnreferencedBlobs(const CancelToken& stop);
  // By digest, and by the lease that stored them.
  struct JobBlobs {
    std::set<std::string> uploaded;
    std::map<std::string, std::vector<std::string>> of_leases;
  };
  absl::StatusOr<JobBlobs> BlobsOf(const std::string& id);
  absl::Status RemoveUnreferencedBlobs(const std::string& id);
  absl::Status NoteBlobsBut(const std::set<std::string>& named, const std::string& id);
  absl::Status RemoveUnreferencedUploads(const std::string& id, std::set<std::string> digests);
  absl::Status MarkSwept(const std::string& id, const std::string& mark,
                         std::set<std::string>* digests);
  absl::StatusOr<std::set<std::string>> BlobsNamedBy(const JobRecord& job);

  JobStore* const store_;
  BlobStore* const blobs_;
  Uploads* const uploads_;
  const DataDir data_;
  const Clock clock_, awake_ms_;
  const InstallationMarker* const marker_;  // of blobs_; may be null
  std::mutex mutex_;                        // held for a sweep; guards the rest
  int64_t now_ms_;                          // when the sweep began: a clock may be set meanwhile
  int64_t started_ms_;                      // when this was made, or the machine woke up
  int64_t ahead_ms_;                        // clock_() of awake_ms_(), when it was looked at last
  struct Jump {
    int64_t at_ms, by_ms;  // of clock_(), after it
    int64_t awake_ms;
  };
  std::vector<Jump> jumps_;  // of the last KeptAfterStartMs() by awake_ms_()
  // Jobs that have folders and no row: since when a server knows, without the times in which none
  // ran. DataDir::missed() keeps it.
  std::map<std::string, int64_t> missed_since_ms_;
  std::optional<int64_t> orphans_seen_ms_;  // when it looked last
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_SWEEPER_H_
