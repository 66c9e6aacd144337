// Requests that make or change a job, checked and turned into what server/jobs takes.
#ifndef LITAGS_SERVER_API_NEW_JOB_H_
#define LITAGS_SERVER_API_NEW_JOB_H_

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/jobs/jobs.h"

namespace litags {

// INVALID_ARGUMENT (REQUEST_ID_INVALID, TEXT_INVALID).
absl::Status CheckRequestId(const std::string& request_id);

// Equal requests have equal digests, whatever order their maps are in.
std::string DigestOf(const google::protobuf::Message& request);

// INVALID_ARGUMENT, naming the field.
absl::StatusOr<NewJob> NewJobOf(const v1::CreateJobRequest& request);
// Of a clone of `source`, which has what the request leaves out.
absl::StatusOr<NewJob> NewJobOf(const v1::CloneJobRequest& request, const JobRecord& source);

// Takes what the request's mask names. INVALID_ARGUMENT: UPDATE_MASK_EMPTY, UPDATE_MASK_INVALID
// (field "update_mask"), and for what it names.
absl::Status ApplyUpdate(const v1::UpdateJobRequest& request, JobDetails* details);

}  // namespace litags

#endif  // LITAGS_SERVER_API_NEW_JOB_H_
