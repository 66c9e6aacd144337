#ifndef LITAGS_SERVER_API_STATUS_H_
#define LITAGS_SERVER_API_STATUS_H_

#include <grpcpp/support/status.h>

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// The answer to a call that ended with `status`: same code, same message, and as the binary details
// an RpcStatus with the ErrorDetail first and then google.rpc's ErrorInfo, BadRequest, QuotaFailure
// and RetryInfo as they fit.
grpc::Status ToGrpc(const absl::Status& status);

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
