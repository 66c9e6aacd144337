#ifndef LITAGS_SERVER_JOBS_MOVE_H_
#define LITAGS_SERVER_JOBS_MOVE_H_

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "server/store/copy_rows.h"
#include "server/store/data_dir.h"
#include "server/store/open_stores.h"

namespace litags {

struct MoveSummary {
  RowSums rows;
  int64_t blobs = 0, blob_bytes = 0;
  int64_t blobs_copied = 0;  // the others were there
  int64_t partial_jobs = 0;  // whose files came in part: clients send those again
};

// Copies the installation of `data` into other stores: every blob of every job, checked against its
// digest, then every row in one transaction; then reads all of the target and compares. The source
// stays as it is, and shares no file with the target. Interrupted, it goes on when it is called
// again; called again after its end, it compares. `note` is told about once a second how far it is.
//
// The caller holds the lock of `data`. FAILED_PRECONDITION (SOURCE_IN_USE) if a worker is there or
// a job is leased, (TARGET_NOT_EMPTY) if a target is the source; errors of CopyRows(),
// CheckBlobsAreOurs() and the stores, with the blob's key for a damaged one.
absl::StatusOr<MoveSummary> MoveInstallation(const StorePlaces& from, const StorePlaces& to,
                                             const DataDir& data,
                                             const std::function<void(const std::string&)>& note);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_MOVE_H_
