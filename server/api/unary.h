#ifndef LITAGS_SERVER_API_UNARY_H_
#define LITAGS_SERVER_API_UNARY_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "server/api/cut_off.h"
#include "server/api/gate.h"
#include "server/api/grpc_order.h"
#include "server/api/stall_timer.h"
#include "server/api/status.h"
#include "server/api/thread_pool.h"

namespace litags {

// One unary call. Deletes itself when the call is over.
class UnaryReactor : public grpc::ServerUnaryReactor {
 public:
  explicit UnaryReactor(grpc::CallbackServerContext* context) : context_(context) {}

  // Ends the call. A client that does not read the answer is cut off.
  void Answer(std::shared_ptr<Call> call, const absl::Status& status) {
    call_ = std::move(call);
    const grpc::Status end = call_->End(status);
    timer_.Start(call_->SecondsToRead(), [context = context_] { CutOff(context); });
    BeforeStart(this);
    Finish(end);
  }

  void OnCancel() override { cancel_.Cancel(); }
  void OnDone() override {
    AfterStart(this);
    delete this;
  }
  // Raised when the client gave up, hung up, or its deadline passed.
  const CancelToken& cancel() const { return cancel_; }

 private:
  grpc::CallbackServerContext* const context_;
  CancelToken cancel_;
  std::shared_ptr<Call> call_;  // counted until the answer was read
  StallTimer timer_;
};

// Answers a unary call with what `work(call, cancel)` returns, run on the pool; the call's request
// and response live until then. The gate's error, or the pool's own if it is busy.
template <typename Work>
grpc::ServerUnaryReactor* RunUnary(Gate* gate, grpc::CallbackServerContext* context, CallName name,
                                   ThreadPool* pool, Work work) {
  auto* reactor = new UnaryReactor(context);
  auto call = gate->Enter(context, name);
  if (!call.ok()) {
    reactor->Finish(gate->Refuse(*context, name, call.status()));
    return reactor;
  }
  const absl::Status accepted =
      pool->Try((*call)->client().name, [reactor, call = *call, work = std::move(work)] {
        // A call that nobody waits for any more costs nothing.
        absl::Status status = reactor->cancel().IsCancelled() ? CallCancelled() : call->CheckWait();
        if (status.ok()) status = work(*call, reactor->cancel());
        reactor->Answer(call, status);
      });
  if (!accepted.ok()) reactor->Answer(*call, accepted);
  return reactor;
}

// The end of a stream that was not let in. Deletes itself when the call is over.
template <typename Reactor>
class RefusedStream : public Reactor {
 public:
  explicit RefusedStream(const grpc::Status& status) { this->Finish(status); }
  void OnDone() override { delete this; }
};

// Makes the reactor of a stream, `make(call)`, or one that refuses it.
template <typename Reactor, typename Make>
Reactor* RunStream(Gate* gate, grpc::CallbackServerContext* context, CallName name, Make make) {
  auto call = gate->Enter(context, name);
  if (!call.ok()) return new RefusedStream<Reactor>(gate->Refuse(*context, name, call.status()));
  return make(*std::move(call));
}

}  // namespace litags

#endif  // LITAGS_SERVER_API_UNARY_H_
