#ifndef LITAGS_SERVER_JOBS_OVERVIEW_H_
#define LITAGS_SERVER_JOBS_OVERVIEW_H_

#include <cstdint>
#include <map>

#include "absl/status/statusor.h"
#include "server/store/job_store.h"

namespace litags {

// How all jobs are at the moment.
struct JobsOverview {
  std::map<JobState, int64_t> by_state;  // every state
  double queue_age_seconds = 0;          // since the job that waits longest was queued
  int64_t unplaceable = 0;               // queued jobs that no worker that is there can take
  int64_t workers = 0;                   // that are there
  double iterations_per_second = 0;      // of all running jobs together
};

// `now_ms`: by the store's clock. Errors of JobStore.
absl::StatusOr<JobsOverview> OverviewOf(JobStore& store, int64_t now_ms);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_OVERVIEW_H_
