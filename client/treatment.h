#ifndef LITAGS_CLIENT_TREATMENT_H_
#define LITAGS_CLIENT_TREATMENT_H_

#include <cstdint>
#include <optional>

#include "CLI/CLI.hpp"
#include "litags/v1/job.pb.h"

namespace litags::client {

// How a job is treated, as far as it was given; the service has the defaults.
struct Treatment {
  std::optional<int> priority;
  std::optional<double> max_run_seconds, retention_seconds;
  std::optional<int64_t> max_memory_bytes;
};

// Adds --priority, --max-run-seconds, --max-memory and --keep-seconds. `treatment` must outlive the
// parsing.
void AddTreatmentOptions(CLI::App& command, Treatment& treatment);

v1::JobPolicy ToProto(const Treatment& treatment);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_TREATMENT_H_
