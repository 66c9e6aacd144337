#ifndef LITAGS_CLIENT_TREATMENT_H_
#define LITAGS_CLIENT_TREATMENT_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "litags/v1/job.pb.h"

namespace litags::client {

// How a job is treated, as far as it was given; the service has the defaults.
struct Treatment {
  std::optional<int> priority, min_cores;
  std::optional<double> max_run_seconds, retention_seconds;
  std::optional<int64_t> max_memory_bytes, min_memory_bytes;
  std::vector<std::string> worker_labels;
};

// Adds --priority, --max-run-seconds, --max-memory, --min-cores and so on. `treatment` must outlive
// the parsing.
void AddTreatmentOptions(CLI::App& command, Treatment& treatment);

// Of a finite number.
google::protobuf::Duration DurationOf(double seconds);
v1::JobPolicy ToProto(const Treatment& treatment);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_TREATMENT_H_
