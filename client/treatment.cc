#include "client/treatment.h"

#include <string>

namespace litags::client {

void AddTreatmentOptions(CLI::App& command, Treatment& treatment) {
  const std::string group = "Treatment";
  command.add_option("--priority", treatment.priority, "Before jobs of less, -100..100; default 0")
      ->group(group);
  command
      .add_option("--max-run-seconds", treatment.max_run_seconds,
                  "Fail the job when it has run for so long; resume goes on")
      ->group(group);
  command
      .add_option("--max-memory", treatment.max_memory_bytes,
                  "Fail the job when it holds more bytes; 4G and the like are understood")
      ->transform(CLI::AsSizeValue(false))
      ->group(group);
  command.add_option("--min-cores", treatment.min_cores, "Cores that the job's worker must have")
      ->group(group);
  command
      .add_option("--min-memory", treatment.min_memory_bytes,
                  "Main memory that its worker must have, as 8G; default: as --max-memory")
      ->transform(CLI::AsSizeValue(false))
      ->group(group);
  command.add_option("--labels", treatment.labels, "Labels its worker must have, as avx512,site-b")
      ->delimiter(',')
      ->group(group);
  command
      .add_option("--keep-seconds", treatment.retention_seconds,
                  "Remove the job so long after its end; 0: never")
      ->group(group);
}

v1::JobPolicy ToProto(const Treatment& treatment) {
  v1::JobPolicy policy;
  if (treatment.priority) policy.set_priority(*treatment.priority);
  if (treatment.max_run_seconds) policy.set_max_run_seconds(*treatment.max_run_seconds);
  if (treatment.max_memory_bytes) policy.set_max_memory_bytes(*treatment.max_memory_bytes);
  if (treatment.retention_seconds) policy.set_retention_seconds(*treatment.retention_seconds);
  if (treatment.min_cores) policy.set_min_cores(*treatment.min_cores);
  if (treatment.min_memory_bytes) policy.set_min_memory_bytes(*treatment.min_memory_bytes);
  policy.mutable_labels()->Add(treatment.labels.begin(), treatment.labels.end());
  return policy;
}

}  // namespace litags::client
