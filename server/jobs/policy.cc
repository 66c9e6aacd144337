#include "server/jobs/policy.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/placement.h"

namespace litags {
namespace {

constexpr int64_t kMinMemoryBytes = int64_t{64} << 20;  // no job runs in less
constexpr int kMaxCores = 65536;
constexpr double kMaxSeconds = 1e9;  // 31 years: milliseconds do not overflow

absl::Status Bad(const char* name, double value, const char* rule) {
  return InvalidInput("POLICY_OUT_OF_RANGE", absl::StrCat("policy.", name),
                      absl::StrCat("policy.", name, " is ", value, "; it must be ", rule));
}

bool IsDuration(double seconds) {
  return std::isfinite(seconds) && seconds >= 0 && seconds <= kMaxSeconds;
}

}  // namespace

absl::Status JobPolicy::Validate() const {
  if (priority < -kMaxJobPriority || priority > kMaxJobPriority) {
    return Bad("priority", priority, "in -100..100");
  }
  if (!IsDuration(max_run_seconds)) {
    return Bad("max_run_time", max_run_seconds, "0 (no limit) or up to 1e9 s");
  }
  if (max_memory_bytes != 0 && max_memory_bytes < kMinMemoryBytes) {
    return Bad("max_memory_bytes", static_cast<double>(max_memory_bytes),
               "0 (no limit) or at least 64 MiB");
  }
  if (!IsDuration(retention_seconds)) {
    return Bad("retention", retention_seconds, "0 (for ever) or up to 1e9 s");
  }
  if (min_cores < 0 || min_cores > kMaxCores) return Bad("min_cores", min_cores, "in 0..65536");
  if (min_memory_bytes < 0 || (max_memory_bytes != 0 && min_memory_bytes > max_memory_bytes)) {
    return Bad("min_memory_bytes", static_cast<double>(min_memory_bytes),
               "0 (as max_memory_bytes) or up to max_memory_bytes");
  }
  return CheckLabels(worker_labels, "policy.worker_labels");
}

}  // namespace litags
