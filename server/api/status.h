#ifndef LITAGS_SERVER_API_STATUS_H_
#define LITAGS_SERVER_API_STATUS_H_

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// The id in "jobs/{id}". INVALID_ARGUMENT (JOB_NAME_INVALID).
absl::StatusOr<std::string> ParseJobName(const std::string& name);

// What a call gets that the client gave up or the server cut short.
absl::Status CallCancelled();
absl::Status ShuttingDown();
// What a call gets for which there is no room.
absl::Status RenderQueueFull(size_t max_waiting);
absl::Status ServerBusy();

}  // namespace litags

#endif  // LITAGS_SERVER_API_STATUS_H_
