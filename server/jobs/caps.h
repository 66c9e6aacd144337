#ifndef LITAGS_SERVER_JOBS_CAPS_H_
#define LITAGS_SERVER_JOBS_CAPS_H_

#include <cstdint>

#include "absl/status/status.h"
#include "engine/pipeline/options.h"
#include "server/jobs/policy.h"

namespace litags {

// How much one job may ask for, as the operator says; 0: as much as there is.
struct JobCaps {
  int max_iterations = 0;
  int64_t max_gaussians = 0;
  double max_run_seconds = 0;  // also of a job that sets no limit itself, see LimitRunTime()
  int max_priority = kMaxJobPriority;
  int64_t max_memory_bytes = 0;

  // RESOURCE_EXHAUSTED (JOB_CAP_EXCEEDED), naming the field and the cap.
  absl::Status Check(const ReconstructOptions& options, const JobPolicy& policy) const;

  // What of it can be changed at any time.
  absl::Status CheckPriority(int priority) const;

  absl::Status CheckRunTime(double seconds) const;

  // What a job was let ask for stays, but for what is more than the cap is now.
  void LimitRunTime(JobPolicy* policy) const {
    *policy = policy->WithoutCap();
    if (max_run_seconds == 0) return;
    policy->run_time_is_cap = policy->max_run_seconds == 0;
    if (policy->run_time_is_cap || policy->max_run_seconds > max_run_seconds) {
      policy->max_run_seconds = max_run_seconds;
    }
  }
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_CAPS_H_
