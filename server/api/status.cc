#include "server/api/status.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"
#include "litags/v1/errors.pb.h"
#include "server/api/scrub.h"

namespace litags {
namespace {

// Codes travel as they are: Abseil's numbers are gRPC's.
static_assert(static_cast<int>(absl::StatusCode::kCancelled) == grpc::CANCELLED);
static_assert(static_cast<int>(absl::StatusCode::kInvalidArgument) == grpc::INVALID_ARGUMENT);
static_assert(static_cast<int>(absl::StatusCode::kNotFound) == grpc::NOT_FOUND);
static_assert(static_cast<int>(absl::StatusCode::kFailedPrecondition) == grpc::FAILED_PRECONDITION);
static_assert(static_cast<int>(absl::StatusCode::kUnauthenticated) == grpc::UNAUTHENTICATED);

constexpr size_t kJobIdLength = 16;
// Of the message and of the field. Clients take trailers of 8 KiB, and these come as a message with
// up to three bytes for one, and with the field in Base64.
constexpr size_t kMaxTextBytes = 1024;

}  // namespace

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const auto code = static_cast<grpc::StatusCode>(status.code());
  const std::string message = Utf8Prefix(MessageForClients(status), kMaxTextBytes);
  const ErrorDetail detail =
      GetErrorDetail(status).value_or(ErrorDetail{absl::StatusCodeToString(status.code()), ""});
  if (code == grpc::INTERNAL || code == grpc::UNKNOWN) spdlog::error("{}", status.ToString());

  v1::ErrorDetail proto_detail;
  proto_detail.set_reason(detail.reason);
  proto_detail.set_field(Utf8Prefix(detail.field, kMaxTextBytes));
  v1::RpcStatus rpc;
  rpc.set_code(code);
  rpc.set_message(message);
  rpc.add_details()->PackFrom(proto_detail);
  return grpc::Status(code, message, rpc.SerializeAsString());
}

absl::StatusOr<std::string> ParseJobName(const std::string& name) {
  constexpr std::string_view kPrefix = "jobs/";
  const std::string id = name.starts_with(kPrefix) ? name.substr(kPrefix.size()) : "";
  const auto is_id_char = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z'); };
  if (id.empty() || id.size() > kJobIdLength || !std::all_of(id.begin(), id.end(), is_id_char)) {
    return InvalidInput("JOB_NAME_INVALID", "name",
                        absl::StrCat("\"", Utf8Prefix(name, 100),
                                     "\" is not a job's name; names have the form jobs/ID, with "
                                     "the ID that CreateJob returned"));
  }
  return id;
}

absl::Status CallCancelled() {
  return MakeError(absl::StatusCode::kCancelled, "CALL_CANCELLED", "", "the call was cancelled");
}

absl::Status ShuttingDown() {
  return MakeError(absl::StatusCode::kUnavailable, "SHUTTING_DOWN", "",
                   "the server shuts down; try again in a moment");
}

absl::Status RenderQueueFull(size_t max_waiting) {
  return MakeError(absl::StatusCode::kResourceExhausted, "RENDER_QUEUE_FULL", "",
                   absl::StrCat(max_waiting,
                                " pictures wait to be rendered, and no more may; try again in a "
                                "second"));
}

absl::Status ServerBusy() {
  return MakeError(absl::StatusCode::kResourceExhausted, "SERVER_BUSY", "",
                   "too many calls wait for the job store; try again in a second");
}

}  // namespace litags
