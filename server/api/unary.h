#ifndef LITAGS_SERVER_API_UNARY_H_
#define LITAGS_SERVER_API_UNARY_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <utility>

#include "absl/status/status.h"
#include "server/api/status.h"
#include "server/api/thread_pool.h"

namespace litags {

// Answers a unary call with what `work` returns, run on the pool; the call's request and response
// live until then. The pool's own error if it is busy.
template <typename Work>
grpc::ServerUnaryReactor* RunUnary(grpc::CallbackServerContext* context, ThreadPool* pool,
                                   Work work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::Status accepted = pool->Try([context, reactor, work = std::move(work)] {
    reactor->Finish(ToGrpc(context->IsCancelled() ? CallCancelled() : work()));
  });
  if (!accepted.ok()) reactor->Finish(ToGrpc(accepted));
  return reactor;
}

}  // namespace litags

#endif  // LITAGS_SERVER_API_UNARY_H_
