// Whether a worker can begin jobs, or would fail every one that it takes.
#ifndef LITAGS_SERVER_WORKER_SELF_CHECK_H_
#define LITAGS_SERVER_WORKER_SELF_CHECK_H_

#include <string>

#include "absl/status/status.h"
#include "server/worker/job_runner.h"

namespace litags {

// Whether the scratch folder takes the files of a small job, and the blob store can be read.
absl::Status CheckWorker(const WorkerContext& context);

// The same; after BLOB_NOT_FOUND, also whether these are the blobs of the server.
absl::Status CheckWorkerAfter(const absl::Status& error, const WorkerContext& context);

// Whether a job could not be begun for what is wrong with this worker (DISK_FULL, STORE_FAILED,
// BLOBS_DENIED, BLOB_NOT_FOUND), which CheckWorkerAfter() finds, too. If it finds nothing, the job
// is at fault: a photo of it cannot be read, say.
bool IsFaultOfWorker(const absl::Status& error, const WorkerContext& context);

// For the job's owner, who does not know the worker's folders: "its disk is full".
std::string TroubleInWords(const absl::Status& error);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_SELF_CHECK_H_
