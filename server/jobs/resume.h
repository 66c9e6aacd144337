#ifndef LITAGS_SERVER_JOBS_RESUME_H_
#define LITAGS_SERVER_JOBS_RESUME_H_

#include <functional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/pipeline/options.h"
#include "server/jobs/policy.h"

namespace litags {

// Changes a job's options and policy when it is resumed: gets what the job has, and may be called
// more than once. Its error is that of the call.
using ResumeChange = std::function<absl::Status(ReconstructOptions&, JobPolicy&)>;

// The options that a job begun with `before` goes on with where `wanted` are asked for. More
// iterations keep the schedules of the earlier ones, which were trained by them already.
// INVALID_ARGUMENT: OPTION_NOT_RESUMABLE (field "options.NAME") for anything else that shapes the
// scene, ITERATIONS_REDUCED ("options.iterations").
absl::StatusOr<ReconstructOptions> ResumedOptions(const ReconstructOptions& before,
                                                  ReconstructOptions wanted);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_RESUME_H_
