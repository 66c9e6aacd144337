#ifndef LITAGS_SERVER_WORKER_LEASE_FOLDER_H_
#define LITAGS_SERVER_WORKER_LEASE_FOLDER_H_

#include <string>

#include "absl/status/statusor.h"
#include "server/jobs/leases.h"
#include "server/store/data_dir.h"

namespace litags {

// The folder in which the holder of a lease works: input/ and run/ below work/JOB/lease-N, N the
// number of the event that began the lease.
//
// What an earlier lease left becomes this folder, by being renamed. The earlier worker, should it
// still be alive, finds its folder gone: as it can write no event, it can write no checkpoint and
// no scene. A worker that lost its lease before it came here takes nothing, since its number is
// lower.
//
// ABORTED (LEASE_LOST) if a later lease has been here; INTERNAL (STORE_FAILED).
absl::StatusOr<std::string> TakeLeaseFolder(const Lease& lease, const DataDir& data);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_LEASE_FOLDER_H_
