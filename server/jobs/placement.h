// Which worker may take which job: what a job needs, and what workers have.
#ifndef LITAGS_SERVER_JOBS_PLACEMENT_H_
#define LITAGS_SERVER_JOBS_PLACEMENT_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/pipeline/options.h"
#include "server/jobs/policy.h"
#include "server/store/job_store.h"

namespace litags {

// What a worker has, or what a job needs at least.
struct Resources {
  int cores = 0;
  int64_t memory_bytes = 0;
  std::vector<std::string> labels;  // sorted, each once; see CheckLabels()
};

// Labels are the operator's own words for what cores and bytes do not say: "avx512", "site-b".
// INVALID_ARGUMENT (LABEL_INVALID) unless there are 8 at most, of 1..63 letters, digits and
// "-_./=".
absl::Status CheckLabels(const std::vector<std::string>& labels, const char* field);
std::vector<std::string> Sorted(std::vector<std::string> labels);

// The label of workers with a depth network: put there by the worker itself, and asked for by the
// options of a job that needs one.
inline constexpr char kDepthNetworkLabel[] = "depth-network";
bool HasDepthNetwork(const Resources& has);

// A job that does not say what memory it needs, but what it may take, needs that. `least`: bytes
// that its photos take, as CheckFiles() has it; counted by whole 256 MiB, so that jobs of like
// needs have equal ones, and below that not at all.
Resources NeedsOf(const JobPolicy& policy, const ReconstructOptions& options, int64_t least = 0);
// The same as JobRecord::needs: equal needs are equal texts; empty: nothing.
std::string EncodedNeedsOf(const JobPolicy& policy, const ReconstructOptions& options,
                           int64_t least = 0);

// `needs`, as JobRecord has them, with the labels that the policy and the options ask for now.
absl::StatusOr<std::string> NeedsWithLabelsOf(const JobPolicy& policy,
                                              const ReconstructOptions& options,
                                              std::string_view needs);

bool Fits(const Resources& needs, const Resources& has);
// The same of JobRecord::needs; false for a text that cannot be read.
bool Fits(std::string_view needs, const Resources& has);

// A worker that has said nothing for so long is not there any more. They speak three times as
// often.
inline constexpr int64_t kWorkerSilenceMs = 30000;

// The workers that are there.
using Workforce = std::vector<Resources>;
absl::StatusOr<Workforce> WorkersThere(ClientStore* store);

// For humans: what a queued job waits for beside its turn, such as "a worker with 64 cores; the
// largest of the 3 that are there has 8"; empty if a worker that is there could take it.
std::string WaitsFor(const JobRecord& job, const Workforce& workers);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_PLACEMENT_H_
