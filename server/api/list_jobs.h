#ifndef LITAGS_SERVER_API_LIST_JOBS_H_
#define LITAGS_SERVER_API_LIST_JOBS_H_

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/jobs/jobs.h"

namespace litags {

// The answer of a call that is about one job; its error if there is none. What others do to its
// turn is left out where the store does not tell.
absl::Status Answer(Jobs& jobs, const absl::StatusOr<JobRecord>& job, v1::Job* response);

// See ListJobs and ListFiles in reconstruction_service.proto.
absl::Status ListJobs(Jobs& jobs, const v1::ListJobsRequest& request,
                      v1::ListJobsResponse* response);
absl::Status ListFiles(Jobs& jobs, const v1::ListFilesRequest& request,
                       v1::ListFilesResponse* response);

}  // namespace litags

#endif  // LITAGS_SERVER_API_LIST_JOBS_H_
