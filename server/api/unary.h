#ifndef LITAGS_SERVER_API_UNARY_H_
#define LITAGS_SERVER_API_UNARY_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "google/protobuf/message.h"
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
  // Of a call, whoever takes it first is to answer: the pool's thread, or the timer of its wait.
  using Turn = std::shared_ptr<std::atomic<bool>>;

  explicit UnaryReactor(grpc::CallbackServerContext* context) : context_(context) {}

  // The call is about to wait for a thread, and does not for ever.
  Turn Await(std::shared_ptr<Call> call) {
    call_ = std::move(call);
    return Await();
  }

  // Runs `next` on the pool, as a call that comes now: it may be refused, or wait too long.
  template <typename Next>
  void GoOn(ThreadPool* pool, Next next) {
    const std::string client = call_->client().name;
    const Turn turn = Await();
    const absl::Status accepted = pool->Try(client, [this, turn, next = std::move(next)] {
      if (turn->exchange(true)) return;
      wait_.Stop();
      next();
    });
    if (!accepted.ok() && !turn->exchange(true)) Answer(accepted);
  }

  // Once the turn is taken.
  template <typename Work>
  void Run(const Work& work) {
    wait_.Stop();
    // A call that nobody waits for any more costs nothing.
    if (cancel_.IsCancelled()) return Answer(CallCancelled());
    work(*call_, cancel_, this);
  }

  // Ends the call. A client that does not read the answer is cut off.
  void Answer(const absl::Status& status) {
    const grpc::Status end = call_->End(status);
    timer_.Start(call_->SecondsToRead(), [context = context_] { CutOff(context); });
    BeforeStart(this);
    Finish(end);
  }

  // Raised when the client gave up, hung up, or its deadline passed.
  void OnCancel() override { cancel_.Cancel(); }
  void OnDone() override {
    AfterStart(this);
    delete this;
  }

 private:
  Turn Await() {
    const Turn turn = std::make_shared<std::atomic<bool>>(false);
    wait_.Start(call_->SecondsToWait(), [this, turn] {
      if (!turn->exchange(true)) Answer(call_->WaitedTooLong());
    });
    return turn;
  }

  grpc::CallbackServerContext* const context_;
  CancelToken cancel_;
  std::shared_ptr<Call> call_;  // counted until the answer was read
  StallTimer wait_, timer_;
};

// A unary call that `work(call, cancel, reactor)`, run on the pool, answers then or later; the
// call's request and response live until then. Else the gate's error, the pool's own if it is busy,
// or WAITED_TOO_LONG.
template <typename Work>
grpc::ServerUnaryReactor* RunUnaryInSteps(Gate* gate, grpc::CallbackServerContext* context,
                                          CallName name, ThreadPool* pool,
                                          const google::protobuf::Message* request, Work work) {
  auto* reactor = new UnaryReactor(context);
  auto call = gate->Enter(context, name, request);
  if (!call.ok()) {
    reactor->Finish(gate->Refuse(*context, name, request, call.status()));
    return reactor;
  }
  const std::string client = (*call)->client().name;
  const UnaryReactor::Turn turn = reactor->Await(*std::move(call));
  // A task that comes too late finds no reactor any more.
  const absl::Status accepted = pool->Try(client, [reactor, turn, work = std::move(work)] {
    if (!turn->exchange(true)) reactor->Run(work);
  });
  if (!accepted.ok() && !turn->exchange(true)) reactor->Answer(accepted);
  return reactor;
}

// The same, answered with `response` as `work(call, cancel)` leaves it; its bytes count until they
// were read.
template <typename Response, typename Work>
grpc::ServerUnaryReactor* RunUnary(Gate* gate, grpc::CallbackServerContext* context, CallName name,
                                   ThreadPool* pool, const google::protobuf::Message* request,
                                   const Response* response, Work work) {
  return RunUnaryInSteps(gate, context, name, pool, request,
                         [response, work = std::move(work)](Call& call, const CancelToken& cancel,
                                                            UnaryReactor* reactor) {
                           const absl::Status status = work(call, cancel);
                           if (status.ok()) {
                             call.Hold(static_cast<int64_t>(response->ByteSizeLong()));
                           }
                           reactor->Answer(status);
                         });
}

// The end of a stream that was not let in. Deletes itself when the call is over.
template <typename Reactor>
class RefusedStream : public Reactor {
 public:
  explicit RefusedStream(const grpc::Status& status) { this->Finish(status); }
  void OnDone() override { delete this; }
};

// Makes the reactor of a stream, `make(call)`, or one that refuses it. The request, null if it
// comes in parts, lives until the reactor hears of the call's end.
template <typename Reactor, typename Make>
Reactor* RunStream(Gate* gate, grpc::CallbackServerContext* context, CallName name,
                   const google::protobuf::Message* request, Make make) {
  auto call = gate->Enter(context, name, request);
  if (call.ok()) return make(*std::move(call));
  return new RefusedStream<Reactor>(gate->Refuse(*context, name, request, call.status()));
}

}  // namespace litags

#endif  // LITAGS_SERVER_API_UNARY_H_
