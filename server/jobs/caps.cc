#include "server/jobs/caps.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

template <typename Number>
absl::Status AtMost(const char* field, const char* flag, Number asked, Number cap, Number no_cap) {
  if (cap == no_cap || asked <= cap) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "JOB_CAP_EXCEEDED", field,
                   absl::StrCat(field, " is ", asked, "; this server takes at most ", cap,
                                ": ask for less, or the operator for a larger ", flag));
}

}  // namespace

absl::Status JobCaps::Check(const ReconstructOptions& options, const JobPolicy& policy) const {
  LITAGS_RETURN_IF_ERROR(
      AtMost("options.iterations", "--max-iterations", options.iterations, max_iterations, 0));
  LITAGS_RETURN_IF_ERROR(AtMost("options.max_gaussians", "--max-gaussians", options.max_gaussians,
                                max_gaussians, int64_t{0}));
  LITAGS_RETURN_IF_ERROR(CheckRunTime(policy.max_run_seconds));
  LITAGS_RETURN_IF_ERROR(CheckPriority(policy.priority));
  LITAGS_RETURN_IF_ERROR(AtMost("policy.max_memory_bytes", "--max-job-memory",
                                policy.max_memory_bytes, max_memory_bytes, int64_t{0}));
  return AtMost("policy.min_memory_bytes", "--max-job-memory", policy.min_memory_bytes,
                max_memory_bytes, int64_t{0});
}

absl::Status JobCaps::CheckPriority(int priority) const {
  return AtMost("policy.priority", "--max-priority", priority, max_priority, kMaxJobPriority);
}

absl::Status JobCaps::CheckRunTime(double seconds) const {
  return AtMost("policy.max_run_time", "--max-run-seconds", seconds, max_run_seconds, 0.0);
}

}  // namespace litags
