#include "client/status.h"

#include <string>

#include "absl/strings/cord.h"

namespace litags::client {
namespace {

constexpr char kDetailUrl[] = "type.googleapis.com/litags.v1.ErrorDetail";

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
  v1::ErrorDetail detail;
  for (const auto& any : rpc_status.details()) {
    if (any.Is<v1::ErrorDetail>() && any.UnpackTo(&detail)) return WithDetail(result, detail);
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

}  // namespace litags::client
