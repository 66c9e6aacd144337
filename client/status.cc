#include "client/status.h"

#include <string>

#include "absl/strings/cord.h"

namespace litags::client {
namespace {

constexpr char kDetailUrl[] = "type.googleapis.com/litags.v1.ErrorDetail";
constexpr char kRetryUrl[] = "type.googleapis.com/google.rpc.RetryInfo";

absl::Status WithDetail(absl::Status status, const v1::ErrorDetail& detail) {
  if (!status.ok()) status.SetPayload(kDetailUrl, absl::Cord(detail.SerializeAsString()));
  return status;
}

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  // gRPC's and Abseil's codes are the same numbers.
  absl::Status result(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  v1::RpcStatus rpc_status;
  if (!rpc_status.ParseFromString(status.error_details())) return result;
  for (const auto& any : rpc_status.details()) {
    v1::ErrorDetail detail;
    if (any.Is<v1::ErrorDetail>() && any.UnpackTo(&detail)) result = WithDetail(result, detail);
    if (any.type_url() == kRetryUrl) result.SetPayload(kRetryUrl, absl::Cord(any.value()));
  }
  return result;
}

absl::Status LocalError(absl::StatusCode code, std::string_view reason, std::string_view field,
                        std::string_view message) {
  v1::ErrorDetail detail;
  detail.set_reason(std::string(reason));
  detail.set_field(std::string(field));
  return WithDetail(absl::Status(code, std::string(message)), detail);
}

v1::ErrorDetail DetailOf(const absl::Status& status) {
  v1::ErrorDetail detail;
  const auto payload = status.GetPayload(kDetailUrl);
  if (payload && !detail.ParseFromString(std::string(*payload))) detail.Clear();
  return detail;
}

bool HasRetryInfo(const absl::Status& status) { return status.GetPayload(kRetryUrl).has_value(); }

}  // namespace litags::client
