#ifndef LITAGS_SERVER_API_CUT_OFF_H_
#define LITAGS_SERVER_API_CUT_OFF_H_

#include <grpcpp/server_context.h>

#include "absl/status/status.h"

namespace litags {

// How a call ends whose client does not take the answer. UNAVAILABLE (ANSWER_NOT_READ).
absl::Status AnswerNotRead();

// Ends the call so for the client, which Finish() cannot while bytes wait to be sent: those are
// dropped, what was started fails, and the reactor is to finish. May be called until OnDone().
void CutOff(grpc::CallbackServerContext* context);

}  // namespace litags

#endif  // LITAGS_SERVER_API_CUT_OFF_H_
