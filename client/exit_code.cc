#include "client/exit_code.h"

#include "client/status.h"

namespace litags::client {
namespace {

// Of codes that may be about anything. `name` is the job itself: its state does not allow the call.
bool IsAboutInput(const absl::Status& status) {
  const v1::ErrorDetail detail = DetailOf(status);
  const bool may_be = absl::IsFailedPrecondition(status) || absl::IsAlreadyExists(status) ||
                      absl::IsResourceExhausted(status);
  return may_be && !detail.field().empty() && detail.field() != "name" &&
         !detail.reason().ends_with("DISK_FULL");
}

}  // namespace

int ExitCodeOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kExitOk;
    case absl::StatusCode::kCancelled:
      return kExitInterrupted;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return kExitBadInput;
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      return kExitUnreachable;
    case absl::StatusCode::kNotFound:
      return kExitNotFound;
    default:
      return IsAboutInput(status) ? kExitBadInput : kExitServerError;
  }
}

}  // namespace litags::client
