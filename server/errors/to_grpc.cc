#include "server/errors/to_grpc.h"

#include <spdlog/spdlog.h>

#include <set>
#include <string_view>

#include "engine/core/error.h"
#include "engine/core/utf8.h"
#include "google/rpc/error_details.pb.h"
#include "litags/v1/errors.pb.h"
#include "server/errors/scrub.h"

namespace litags {
namespace {

// Codes travel as they are: Abseil's numbers are gRPC's.
static_assert(static_cast<int>(absl::StatusCode::kCancelled) == grpc::CANCELLED);
static_assert(static_cast<int>(absl::StatusCode::kInvalidArgument) == grpc::INVALID_ARGUMENT);
static_assert(static_cast<int>(absl::StatusCode::kNotFound) == grpc::NOT_FOUND);
static_assert(static_cast<int>(absl::StatusCode::kFailedPrecondition) == grpc::FAILED_PRECONDITION);
static_assert(static_cast<int>(absl::StatusCode::kUnauthenticated) == grpc::UNAUTHENTICATED);

// Clients take trailers of 8 KiB. The message comes with up to three bytes for one, and again in
// Base64, with the field in each of the details.
constexpr size_t kMaxMessageBytes = 1024;
constexpr size_t kMaxDetailBytes = 300;

constexpr char kDomain[] = "litags";  // of ErrorInfo's reasons

// A client has used up what it may have; waiting alone frees nothing.
bool IsQuota(std::string_view reason) {
  static const std::set<std::string_view> kReasons = {"BYTE_QUOTA_REACHED", "JOB_QUOTA_REACHED"};
  return kReasons.contains(reason);
}

// The same call may succeed later as it is.
bool IsTransient(grpc::StatusCode code, std::string_view reason) {
  static const std::set<std::string_view> kReasons = {"SERVER_BUSY", "RENDER_QUEUE_FULL",
                                                      "PICTURE_RATE_EXCEEDED", "TOO_MANY_STREAMS",
                                                      "WAITED_TOO_LONG"};
  // After STORE_OUTCOME_UNKNOWN the client looks first whether its change was made.
  return kReasons.contains(reason) ||
         (code == grpc::UNAVAILABLE && reason != "STORE_OUTCOME_UNKNOWN");
}

// The details that libraries of every language read (AIP-193).
void AddGoogleDetails(grpc::StatusCode code, const std::string& message, const ErrorDetail& detail,
                      v1::RpcStatus* rpc) {
  google::rpc::ErrorInfo info;
  info.set_reason(detail.reason);
  info.set_domain(kDomain);
  if (!detail.field.empty()) (*info.mutable_metadata())["field"] = detail.field;
  rpc->add_details()->PackFrom(info);
  if (!detail.field.empty() && code == grpc::INVALID_ARGUMENT) {
    google::rpc::BadRequest request;
    auto* violation = request.add_field_violations();
    violation->set_field(detail.field);
    violation->set_description(Utf8Prefix(message, kMaxDetailBytes));
    rpc->add_details()->PackFrom(request);
  }
  if (IsQuota(detail.reason)) {
    google::rpc::QuotaFailure quota;
    auto* violation = quota.add_violations();
    violation->set_subject("client");
    violation->set_description(Utf8Prefix(message, kMaxDetailBytes));
    rpc->add_details()->PackFrom(quota);
  }
  if (IsTransient(code, detail.reason)) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_seconds(kRetrySeconds);
    rpc->add_details()->PackFrom(retry);
  }
}

}  // namespace

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const auto code = static_cast<grpc::StatusCode>(status.code());
  const std::string message = Utf8Prefix(MessageForClients(status), kMaxMessageBytes);
  ErrorDetail detail = DetailForClients(status);
  detail.field = Utf8Prefix(detail.field, kMaxDetailBytes);
  if (code == grpc::INTERNAL || code == grpc::UNKNOWN) {
    spdlog::error("{} ({})", std::string(status.message()), detail.reason);
  }

  v1::ErrorDetail proto_detail;
  proto_detail.set_reason(detail.reason);
  proto_detail.set_field(detail.field);
  v1::RpcStatus rpc;
  rpc.set_code(code);
  rpc.set_message(message);
  rpc.add_details()->PackFrom(proto_detail);
  AddGoogleDetails(code, message, detail, &rpc);
  return grpc::Status(code, message, rpc.SerializeAsString());
}

}  // namespace litags
