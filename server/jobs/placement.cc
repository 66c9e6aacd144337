#include "server/jobs/placement.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/pipeline/depth_maps.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

constexpr size_t kMaxLabels = 8, kMaxLabelLength = 63;
constexpr int64_t kMemoryStep = int64_t{256} << 20;

bool IsLabel(const std::string& label) {
  return !label.empty() && label.size() <= kMaxLabelLength &&
         label.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
             "-_./=") == std::string::npos;
}

// A worker leaves an eighth of its memory to itself (JobMonitor).
int64_t WithWorkersShare(int64_t bytes) { return bytes + (bytes + 6) / 7; }

bool IsNothing(const Resources& needs) {
  return needs.cores == 0 && needs.memory_bytes == 0 && needs.labels.empty();
}

std::string MiB(int64_t bytes) {
  return absl::StrCat((bytes >> 20) + (bytes % (1 << 20) != 0), " MiB");
}

std::string Encoded(const Resources& needs) { return IsNothing(needs) ? "" : Encode(needs); }

std::string InWords(const Resources& needs) {
  std::vector<std::string> parts;
  if (needs.cores > 0) parts.push_back(Counted(needs.cores, "core"));
  if (needs.memory_bytes > 0) {
    parts.push_back(absl::StrCat(MiB(needs.memory_bytes), " of memory"));
  }
  for (const std::string& label : needs.labels) parts.push_back(absl::StrCat("label ", label));
  return parts.empty() ? "a worker" : absl::StrCat("a worker with ", absl::StrJoin(parts, ", "));
}

}  // namespace

absl::Status CheckLabels(const std::vector<std::string>& labels, const char* field) {
  if (labels.size() <= kMaxLabels && std::all_of(labels.begin(), labels.end(), IsLabel)) {
    return absl::OkStatus();
  }
  return InvalidInput(
      "LABEL_INVALID", field,
      absl::StrCat(field, " are \"", absl::StrJoin(labels, ","), "\"; there may be ", kMaxLabels,
                   ", each of 1..", kMaxLabelLength, " letters, digits and -_./="));
}

std::vector<std::string> Sorted(std::vector<std::string> labels) {
  std::sort(labels.begin(), labels.end());
  labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
  return labels;
}

bool HasDepthNetwork(const Resources& has) {
  return std::binary_search(has.labels.begin(), has.labels.end(), kDepthNetworkLabel);
}

Resources NeedsOf(const JobPolicy& policy, const ReconstructOptions& options, int64_t least) {
  std::vector<std::string> labels = policy.worker_labels;
  if (ResolveDepthOrigin(options.ResolveRecipe(), options, {}) == DepthOrigin::kNetwork) {
    labels.emplace_back(kDepthNetworkLabel);
  }
  // Without a limit of its own a job may take what its worker leaves it.
  if (policy.max_memory_bytes == 0) least = WithWorkersShare(least);
  const int64_t asked =
      policy.min_memory_bytes > 0 ? policy.min_memory_bytes : policy.max_memory_bytes;
  return {policy.min_cores, std::max(asked, least - least % kMemoryStep),
          Sorted(std::move(labels))};
}

std::string EncodedNeedsOf(const JobPolicy& policy, const ReconstructOptions& options,
                           int64_t least) {
  return Encoded(NeedsOf(policy, options, least));
}

absl::StatusOr<std::string> NeedsWithLabelsOf(const JobPolicy& policy,
                                              const ReconstructOptions& options,
                                              std::string_view needs) {
  Resources changed;
  if (!needs.empty()) {
    LITAGS_ASSIGN_OR_RETURN(changed, Decode<Resources>(needs));
  }
  changed.labels = NeedsOf(policy, options).labels;
  return Encoded(changed);
}

bool Fits(const Resources& needs, const Resources& has) {
  return needs.cores <= has.cores && needs.memory_bytes <= has.memory_bytes &&
         std::includes(has.labels.begin(), has.labels.end(), needs.labels.begin(),
                       needs.labels.end());
}

bool Fits(std::string_view needs, const Resources& has) {
  if (needs.empty()) return true;
  const auto decoded = Decode<Resources>(needs);
  return decoded.ok() && Fits(*decoded, has);
}

absl::StatusOr<Workforce> WorkersThere(ClientStore* store) {
  const int64_t now_ms = store->NowMs();
  LITAGS_ASSIGN_OR_RETURN(const auto records, store->Workers(now_ms - kWorkerSilenceMs));
  Workforce workers;
  for (const WorkerRecord& record : records) {
    // Of before the clock was set back: a living worker says so again.
    if (record.seen_ms > now_ms + kWorkerSilenceMs) continue;
    LITAGS_ASSIGN_OR_RETURN(Resources has, Decode<Resources>(record.resources));
    workers.push_back(std::move(has));
  }
  return workers;
}

std::string WaitsFor(const JobRecord& job, const Workforce& workers) {
  if (job.state != JobState::kQueued) return "";
  if (workers.empty()) return "a worker; none is there";
  Resources needs;
  if (!job.needs.empty()) {
    const auto decoded = Decode<Resources>(job.needs);
    if (!decoded.ok()) return std::string(decoded.status().message());
    needs = *decoded;
  }
  Resources most;  // of any one of them; labels are not named, they are the operator's
  for (const Resources& has : workers) {
    if (Fits(needs, has)) return "";
    most.cores = std::max(most.cores, has.cores);
    most.memory_bytes = std::max(most.memory_bytes, has.memory_bytes);
  }
  const std::string there = workers.size() == 1
                                ? "the only one that is there has "
                                : absl::StrCat("of the ", workers.size(),
                                               " that are there none has all of it, the largest ");
  const auto policy = PolicyOf(job);
  const bool of_photos =
      policy.ok() && needs.memory_bytes > most.memory_bytes &&
      needs.memory_bytes > std::max(policy->min_memory_bytes, policy->max_memory_bytes);
  return absl::StrCat(InWords(needs), "; ", there, Counted(most.cores, "core"), " and ",
                      MiB(most.memory_bytes),
                      of_photos ? "; its photos take the memory: less in a clone of the job with a "
                                  "smaller max_image_side"
                                : "");
}

}  // namespace litags
