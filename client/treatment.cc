#include "client/treatment.h"

#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "proto/arguments/arguments.h"

namespace litags::client {

google::protobuf::Duration DurationOf(double seconds) {
  constexpr double kMostSeconds = 3e11;  // a Duration ends soon after; the service takes far less
  return google::protobuf::util::TimeUtil::MillisecondsToDuration(
      static_cast<int64_t>(std::llround(1000 * std::clamp(seconds, -kMostSeconds, kMostSeconds))));
}

void AddTreatmentOptions(CLI::App& command, Treatment& treatment) {
  const std::string group = "Treatment";
  command
      .add_option("--priority", treatment.priority,
                  "Priority in the queue, -100..100: the highest first; default 0")
      ->group(group);
  command
      .add_option("--max-run-seconds", treatment.max_run_seconds,
                  "Fail the job when it has run for so long; resume goes on")
      ->check(AtLeastZero(0.0))
      ->group(group);
  command
      .add_option("--max-memory", treatment.max_memory_bytes,
                  "Fail the job when it holds more bytes; 4G and the like are understood")
      ->transform(ByteSize())
      ->group(group);
  command.add_option("--min-cores", treatment.min_cores, "Cores that the job's worker must have")
      ->group(group);
  command
      .add_option("--min-memory", treatment.min_memory_bytes,
                  "Main memory that its worker must have, as 8G; default: as --max-memory")
      ->transform(ByteSize())
      ->group(group);
  command
      .add_option("--worker-labels", treatment.worker_labels,
                  "Labels its worker must have, as avx512,site-b")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--keep-seconds", treatment.retention_seconds,
                  "Remove the job so long after its end; 0: never")
      ->check(AtLeastZero(0.0))
      ->group(group);
}

v1::JobPolicy ToProto(const Treatment& treatment) {
  v1::JobPolicy policy;
  if (treatment.priority) policy.set_priority(*treatment.priority);
  if (treatment.max_run_seconds) {
    *policy.mutable_max_run_time() = DurationOf(*treatment.max_run_seconds);
  }
  if (treatment.max_memory_bytes) policy.set_max_memory_bytes(*treatment.max_memory_bytes);
  if (treatment.retention_seconds) {
    *policy.mutable_retention() = DurationOf(*treatment.retention_seconds);
  }
  if (treatment.min_cores) policy.set_min_cores(*treatment.min_cores);
  if (treatment.min_memory_bytes) policy.set_min_memory_bytes(*treatment.min_memory_bytes);
  policy.mutable_worker_labels()->Add(treatment.worker_labels.begin(),
                                      treatment.worker_labels.end());
  return policy;
}

}  // namespace litags::client
