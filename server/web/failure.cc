#include "server/web/failure.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "google/rpc/error_details.pb.h"
#include "litags/v1/errors.pb.h"
#include "server/errors/to_grpc.h"

namespace litags::web {
namespace {

// Whether the same call may succeed later: the service says so, or gRPC found no service.
bool MayComeAgain(const v1::RpcStatus& rpc) {
  if (rpc.details().empty()) return rpc.code() == grpc::UNAVAILABLE;
  return std::any_of(rpc.details().begin(), rpc.details().end(), [](const auto& detail) {
    return detail.template Is<google::rpc::RetryInfo>();
  });
}

// Whether the request by itself is more than the service takes, whoever asks and whenever.
bool IsTooLarge(const v1::RpcStatus& rpc) {
  google::rpc::ErrorInfo info;
  for (const auto& detail : rpc.details()) detail.UnpackTo(&info);
  const std::string& reason = info.reason();
  return absl::EndsWith(reason, "_TOO_LARGE") || reason == "TOO_MANY_FILES" ||
         reason == "ARCHIVE_TOO_MANY_ENTRIES";
}

v1::RpcStatus ToRpc(const grpc::Status& status) {
  v1::RpcStatus rpc;
  if (!rpc.ParseFromString(status.error_details())) rpc.Clear();
  rpc.set_code(status.error_code());
  rpc.set_message(status.error_message());
  return rpc;
}

}  // namespace

int HttpCode(grpc::StatusCode code) {
  switch (code) {
    case grpc::OK:
      return 200;
    case grpc::INVALID_ARGUMENT:
    case grpc::FAILED_PRECONDITION:
    case grpc::OUT_OF_RANGE:
      return 400;
    case grpc::UNAUTHENTICATED:
      return 401;
    case grpc::PERMISSION_DENIED:
      return 403;
    case grpc::NOT_FOUND:
      return 404;
    case grpc::ALREADY_EXISTS:
    case grpc::ABORTED:
      return 409;
    case grpc::RESOURCE_EXHAUSTED:
      return 429;
    case grpc::CANCELLED:
      return 499;
    case grpc::UNIMPLEMENTED:
      return 501;
    case grpc::UNAVAILABLE:
      return 503;
    case grpc::DEADLINE_EXCEEDED:
      return 504;
    default:
      return 500;
  }
}

std::string ReasonOf(const grpc::Status& status) {
  const v1::RpcStatus rpc = ToRpc(status);
  v1::ErrorDetail detail;
  for (const auto& any : rpc.details()) {
    if (any.UnpackTo(&detail)) return detail.reason();
  }
  return "";
}

std::string FailureJson(const grpc::Status& status) {
  v1::RpcStatus rpc = ToRpc(status);
  std::string json;
  if (google::protobuf::util::MessageToJsonString(rpc, &json).ok()) return json;
  // A detail of a kind that this program does not know, or a text that is not UTF-8.
  rpc.clear_details();
  rpc.clear_message();
  json.clear();
  if (!google::protobuf::util::MessageToJsonString(rpc, &json).ok()) return "{}";
  return json;
}

Answer Failure(const grpc::Status& status) {
  Answer answer;
  const v1::RpcStatus rpc = ToRpc(status);
  answer.code = rpc.code() == grpc::RESOURCE_EXHAUSTED && IsTooLarge(rpc)
                    ? 413
                    : HttpCode(status.error_code());
  answer.type = "application/json";
  answer.body = FailureJson(status);
  if (MayComeAgain(rpc)) answer.headers.emplace_back("Retry-After", absl::StrCat(kRetrySeconds));
  if (answer.code == 401) answer.headers.emplace_back("WWW-Authenticate", "Bearer");
  return answer;
}

Answer Failure(const absl::Status& status, int http_code) {
  Answer answer = Failure(ToGrpc(status));
  if (http_code != 0) answer.code = http_code;
  return answer;
}

Answer WrongMethod(const std::string& allowed) {
  Answer answer = Failure(MakeError(absl::StatusCode::kUnimplemented, "METHOD_UNKNOWN", "method",
                                    absl::StrCat("this address takes ", allowed)),
                          405);
  answer.headers.emplace_back("Allow", allowed);
  return answer;
}

}  // namespace litags::web
