// Errors as the client sees them: absl::Status with the service's ErrorDetail attached.
#ifndef LITAGS_CLIENT_STATUS_H_
#define LITAGS_CLIENT_STATUS_H_

#include <string_view>

#include "absl/status/status.h"
#include "grpcpp/support/status.h"
#include "litags/v1/errors.pb.h"

namespace litags::client {

// Why a call to the service failed, with the ErrorDetail of its grpc-status-details-bin trailer,
// and whether there was a google.rpc.RetryInfo.
absl::Status FromGrpc(const grpc::Status& status);

// An error found on this side of the wire; same shape as those of the service. `message` says
// what is wrong and what to do about it; `field` may be empty.
absl::Status LocalError(absl::StatusCode code, std::string_view reason, std::string_view field,
                        std::string_view message);

inline absl::Status BadInput(std::string_view reason, std::string_view field,
                             std::string_view message) {
  return LocalError(absl::StatusCode::kInvalidArgument, reason, field, message);
}

// The detail of an error; empty fields if it has none.
v1::ErrorDetail DetailOf(const absl::Status& status);

// Whether the service said that the same call may succeed later.
bool HasRetryInfo(const absl::Status& status);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_STATUS_H_
