#ifndef LITAGS_SERVER_API_ANSWER_STREAM_H_
#define LITAGS_SERVER_API_ANSWER_STREAM_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "server/api/cut_off.h"
#include "server/api/gate.h"
#include "server/api/grpc_order.h"
#include "server/api/stall_timer.h"
#include "server/api/status.h"
#include "server/api/thread_pool.h"

namespace litags {

// A stream of large answers: the next is made on the pool once the client took the last, and while
// there is room for it. A client that takes nothing for too long is cut off. Deletes itself when
// the call is over.
template <typename Message>
class AnswerStream : public grpc::ServerWriteReactor<Message> {
 public:
  void OnWriteDone(bool ok) final {
    AfterStart(this);
    const bool stalled = timer_.Stop();
    call_->Hold(0);
    if (stalled) return End(AnswerNotRead());
    if (!ok) return End(CallCancelled());
    GoOn();
  }

  void OnCancel() final { cancel_.Cancel(); }

  void OnDone() final { delete this; }

 protected:
  AnswerStream(std::shared_ptr<Call> call, grpc::CallbackServerContext* context, ThreadPool* pool)
      : call_(std::move(call)), context_(context), pool_(pool) {}

  // To be called last in the constructor.
  void Begin() {
    const absl::Status accepted = pool_->Try(call_->client().name, [this] { Step(); });
    if (!accepted.ok()) End(accepted);
  }

  enum class Made { kMessage, kLater };
  // Makes the next message. kLater: it cannot yet, and calls GoOn() when it can. On the pool.
  virtual absl::StatusOr<Made> Next(Message* message) = 0;
  // Whether there is no next message. The end needs no room: a client that reads it first, and then
  // another answer which has taken the room, would wait for itself.
  virtual bool IsDone() const = 0;
  // OK if there is room for what Next() makes; else it is asked again in a moment.
  virtual absl::Status CheckRoom() { return call_->CheckRoom(); }

  Call& call() { return *call_; }
  const CancelToken& cancel() const { return cancel_; }

  // Makes the messages after this one on another pool. In Next().
  void MoveTo(ThreadPool* pool) { pool_ = pool; }

  void GoOn() {
    pool_->Run(call_->client().name, [this] { Step(); });
  }

 private:
  void Step() {
    if (cancel_.IsCancelled()) return End(CallCancelled());
    if (IsDone()) return End(absl::OkStatus());
    if (const absl::Status known = call_->CheckToken(); !known.ok()) return End(known);
    if (const absl::Status room = CheckRoom(); !room.ok()) return AwaitRoom(room);
    waited_seconds_ = 0;
    const absl::StatusOr<Made> made = Next(&message_);
    if (!made.ok()) return End(made.status());
    if (*made == Made::kLater) return;  // another thread may be at it by now
    call_->Hold(static_cast<int64_t>(message_.ByteSizeLong()));
    timer_.Start(call_->SecondsToRead(), [this] { CutOff(context_); });
    BeforeStart(this);
    this->StartWrite(&message_);
  }

  void AwaitRoom(const absl::Status& room) {
    constexpr double kPauseSeconds = 0.2;
    waited_seconds_ += kPauseSeconds;
    if (waited_seconds_ > call_->SecondsToRead()) return End(room);
    timer_.Start(kPauseSeconds, [this] { GoOn(); });
  }

  void End(const absl::Status& status) { this->Finish(call_->End(status)); }

  const std::shared_ptr<Call> call_;
  grpc::CallbackServerContext* const context_;
  ThreadPool* pool_;
  CancelToken cancel_;
  StallTimer timer_;
  double waited_seconds_ = 0;  // for room
  Message message_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_ANSWER_STREAM_H_
