#include "server/api/cut_off.h"

#include <grpc/grpc.h>

#include <string>

#include "engine/core/error.h"

namespace litags {

absl::Status AnswerNotRead() {
  return MakeError(absl::StatusCode::kUnavailable, "ANSWER_NOT_READ", "",
                   "the answer was not read in time and was dropped; call again and read it at "
                   "once");
}

void CutOff(grpc::CallbackServerContext* context) {
  // As TryCancel(), which would not say why.
  const absl::Status status = AnswerNotRead();
  grpc_call_cancel_with_status(context->c_call(), GRPC_STATUS_UNAVAILABLE,
                               std::string(status.message()).c_str(), nullptr);
}

}  // namespace litags
