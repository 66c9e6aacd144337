#ifndef LITAGS_SERVER_JOBS_POLICY_H_
#define LITAGS_SERVER_JOBS_POLICY_H_

#include <cstdint>

#include "absl/status/status.h"

namespace litags {

// How a job is treated, whatever it reconstructs.
struct JobPolicy {
  int priority = 0;              // -100..100; higher ones leave the queue first
  double max_run_seconds = 0;    // with a worker, since it was last queued by a user; 0: no limit
  int64_t max_memory_bytes = 0;  // of the worker's process and its children; 0: no limit
  double retention_seconds = 0;  // from its end until it is removed; 0: never

  // INVALID_ARGUMENT (POLICY_OUT_OF_RANGE, field "policy.NAME").
  absl::Status Validate() const;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_POLICY_H_
