// Whether a worker can begin jobs, or would fail every one that it takes.
#ifndef LITAGS_SERVER_WORKER_SELF_CHECK_H_
#define LITAGS_SERVER_WORKER_SELF_CHECK_H_

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "server/worker/job_runner.h"

namespace litags {

// Writes so much into the scratch folder, and reads from the blob store.
absl::Status CheckWorker(const WorkerContext& context, int64_t room_bytes = int64_t{1} << 20);

// Whether a job could not be begun for what is wrong with this worker (DISK_FULL, STORE_FAILED,
// BLOBS_DENIED), which CheckWorker() finds, too, or would with the room of a small job. If it finds
// nothing, the job is at fault: a photo of it cannot be read, say.
bool IsFaultOfWorker(const absl::Status& error, const WorkerContext& context);

// For the job's owner, who does not know the worker's folders: "its disk is full".
std::string TroubleInWords(const absl::Status& error);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_SELF_CHECK_H_
