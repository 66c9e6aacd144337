#ifndef LITAGS_SERVER_JOBS_POLICY_H_
#define LITAGS_SERVER_JOBS_POLICY_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace litags {

inline constexpr int kMaxJobPriority = 100;  // and -100 the least

// How a job is treated, whatever it reconstructs.
struct JobPolicy {
  int priority = 0;              // -100..100; higher ones leave the queue first
  double max_run_seconds = 0;    // with a worker, since it was last queued by a user; 0: no limit
  bool run_time_is_cap = false;  // the job asked for no limit, and has the operator's
  int64_t max_memory_bytes = 0;  // of the worker's process and its children; 0: no limit
  double retention_seconds = 0;  // from its end until it is removed; 0: never
  // What a worker must have to take the job; see placement.h.
  int min_cores = 0;
  int64_t min_memory_bytes = 0;  // 0: max_memory_bytes
  std::vector<std::string> worker_labels;

  // What a new job is to ask for that is treated alike.
  JobPolicy WithoutCap() const {
    JobPolicy asked = *this;
    if (run_time_is_cap) asked.max_run_seconds = 0;
    asked.run_time_is_cap = false;
    return asked;
  }

  // INVALID_ARGUMENT (POLICY_OUT_OF_RANGE, LABEL_INVALID; field "policy.NAME").
  absl::Status Validate() const;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_POLICY_H_
