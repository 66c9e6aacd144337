#ifndef LITAGS_SERVER_API_JOB_FILTER_H_
#define LITAGS_SERVER_API_JOB_FILTER_H_

#include <functional>
#include <string_view>

#include "absl/status/statusor.h"
#include "server/store/job_store.h"

namespace litags {

using JobFilter = std::function<bool(const JobRecord&)>;

// ListJobsRequest.filter, a subset of AIP-160 (https://google.aip.dev/160). As there, OR binds more
// tightly than AND. An empty text lets all jobs through.
// INVALID_ARGUMENT (FILTER_INVALID), with the place in the text.
absl::StatusOr<JobFilter> ParseJobFilter(std::string_view text);

}  // namespace litags

#endif  // LITAGS_SERVER_API_JOB_FILTER_H_
