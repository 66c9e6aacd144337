#ifndef LITAGS_SERVER_JOBS_WORK_IMPORT_H_
#define LITAGS_SERVER_JOBS_WORK_IMPORT_H_

#include "absl/status/status.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/job_store.h"

namespace litags {

// Earlier versions kept checkpoints and scenes in folders, work/JOB/lease-N/run or work/JOB/run.
// Brings what is there into the blob store, names it in the jobs, and removes the folders. Folders
// of jobs that are not there are left alone. Interrupted, it goes on when it is called again. For
// one process at a time, before anything runs.
absl::Status ImportWorkFolders(JobStore* store, BlobStore* blobs, const DataDir& data);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_WORK_IMPORT_H_
