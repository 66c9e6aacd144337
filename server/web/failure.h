#ifndef LITAGS_SERVER_WEB_FAILURE_H_
#define LITAGS_SERVER_WEB_FAILURE_H_

#include <grpcpp/support/status.h>

#include <string>

#include "absl/status/status.h"
#include "server/web/http.h"

namespace litags::web {

// The HTTP code of a gRPC code, as google.rpc.Code names it.
int HttpCode(grpc::StatusCode code);

// That of the ErrorDetail that a call's status carries; empty if it has none.
std::string ReasonOf(const grpc::Status& status);

// google.rpc.Status as JSON, with the details that the call's status carries.
std::string FailureJson(const grpc::Status& status);

// A call that ended with an error.
Answer Failure(const grpc::Status& status);
// An error of the gateway itself, as the services say it. `http_code` 0: that of the status.
Answer Failure(const absl::Status& status, int http_code = 0);

// The address takes other methods: `allowed`, as "GET, PUT".
Answer WrongMethod(const std::string& allowed);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_FAILURE_H_
