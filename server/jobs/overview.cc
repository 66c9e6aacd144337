#include "server/jobs/overview.h"

#include <algorithm>

#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/placement.h"
#include "server/jobs/state_machine.h"

namespace litags {

absl::StatusOr<JobsOverview> OverviewOf(JobStore& store, int64_t now_ms) {
  LITAGS_ASSIGN_OR_RETURN(const JobCensus census, store.Census());
  JobsOverview overview;
  for (const JobState state : kAllJobStates) overview.by_state[state] = 0;
  for (const auto& [state, count] : census.by_state) overview.by_state[state] = count;
  if (census.oldest_queue_time_ms > 0) {
    // A clock that was set back makes no negative age.
    const int64_t age_ms = std::max(int64_t{0}, now_ms - census.oldest_queue_time_ms);
    overview.queue_age_seconds = static_cast<double>(age_ms) / 1000;
  }
  LITAGS_ASSIGN_OR_RETURN(const Workforce workers, WorkersThere(&store));
  overview.workers = static_cast<int64_t>(workers.size());
  for (const auto& [needs, count] : census.queued_by_needs) {
    const bool fits =
        std::any_of(workers.begin(), workers.end(),
                    [&needs = needs](const Resources& has) { return Fits(needs, has); });
    if (!fits) overview.unplaceable += count;
  }
  for (const std::string& json : census.running_progress) {
    if (json.empty()) continue;
    LITAGS_ASSIGN_OR_RETURN(const ProgressRecord record, Decode<ProgressRecord>(json));
    overview.iterations_per_second += record.progress.iterations_per_second;
  }
  return overview;
}

}  // namespace litags
