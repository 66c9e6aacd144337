#ifndef LITAGS_SERVER_ERRORS_TO_GRPC_H_
#define LITAGS_SERVER_ERRORS_TO_GRPC_H_

#include <grpcpp/support/status.h>

#include "absl/status/status.h"

namespace litags {

// How long a client waits at the least before it calls again.
inline constexpr int kRetrySeconds = 1;

// The answer to a call that ended with `status`: same code, same message, and as the binary details
// an RpcStatus with the ErrorDetail first and then google.rpc's ErrorInfo, BadRequest, QuotaFailure
// and RetryInfo as they fit.
grpc::Status ToGrpc(const absl::Status& status);

}  // namespace litags

#endif  // LITAGS_SERVER_ERRORS_TO_GRPC_H_
