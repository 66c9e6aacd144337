#include "server/web/rpc_call.h"

#include <grpcpp/client_context.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/client_callback.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <mutex>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;

// Between two looks whether somebody is there for the answer.
constexpr std::chrono::milliseconds kLookEvery{100};
// An answer is there as bytes and as a message, then as the text made of it, which is longer.
constexpr int kCopies = 2;

grpc::ByteBuffer BytesOf(const google::protobuf::Message& message) {
  const grpc::Slice slice(message.SerializeAsString());
  return grpc::ByteBuffer(&slice, 1);
}

// Whose room the call's answers take; nullopt: nobody has let it in.
std::optional<std::string> RoomOf(
    const std::multimap<grpc::string_ref, grpc::string_ref>& headers) {
  const auto found = headers.find(kRoomOfHeader);
  if (found == headers.end()) return std::nullopt;
  return std::string(found->second.data(), found->second.size());
}

}  // namespace

// gRPC's threads tell what has happened; it is taken note of on the strand alone.
class RpcCall::Reactor : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                         public std::enable_shared_from_this<Reactor> {
 public:
  // Something that was begun, until it is over.
  struct Step {
    bool begun = false, over = false, ok = false;
  };

  Reactor(asio::any_io_executor executor, std::function<bool()> gone, SharedRoom* unread)
      : executor_(asio::prefer(std::move(executor), asio::execution::outstanding_work.tracked)),
        timer_(executor_),
        gone_(std::move(gone)),
        unread_(unread) {}

  void Start(grpc::GenericStub* stub, std::string_view method,
             const std::multimap<std::string, std::string>& metadata) {
    for (const auto& [name, value] : metadata) context_.AddMetadata(name, value);
    self_ = shared_from_this();
    stub->PrepareBidiStreamingCall(&context_, absl::StrCat("/litags.v1.", std::string(method)), {},
                                   this);
    AddHold();  // the coroutine begins reads and writes, also after the other end has finished
    // In process, an answer that comes with the end of the call is lost, and the server never done
    // with the call, if nobody waits for it then: gRPC 1.51 lets the status overtake it.
    BeginRead();
    StartCall();
  }

  void BeginWrite(grpc::ByteBuffer bytes, bool last) {
    out_ = std::move(bytes);
    write = {true};
    if (last) {
      StartWriteLast(&out_, grpc::WriteOptions());
    } else {
      StartWrite(&out_);
    }
  }
  void BeginRead() {
    if (read.begun) return;
    held_ = {};
    read = {true};
    StartRead(&in_);
  }
  grpc::ByteBuffer TakeRead() {
    read = {};
    return std::exchange(in_, grpc::ByteBuffer());
  }
  HeldRoom TakeHeld() { return std::move(held_); }
  bool let_in() {
    const std::lock_guard lock(mutex_);
    return client_.has_value();
  }
  void LetGo() {
    if (std::exchange(let_go_, true)) return;
    RemoveHold();
  }
  void Cancel() { context_.TryCancel(); }

  // Until the step is over, or for so long. False: it is not over.
  asio::awaitable<bool> Wait(const Step& step, double seconds = 1e9) {
    const auto self = shared_from_this();
    const auto until = std::chrono::steady_clock::now() +
                       std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                           std::chrono::duration<double>(seconds));
    while (!step.over) {
      if (gone_()) Cancel();
      if (std::chrono::steady_clock::now() >= until) co_return false;
      timer_.expires_after(kLookEvery);
      boost::system::error_code ignored;
      co_await timer_.async_wait(asio::redirect_error(asio::use_awaitable, ignored));
    }
    co_return true;
  }

  Step write, read, done;
  grpc::Status status;

 private:
  void OnWriteDone(bool ok) override { Note(&write, ok); }
  // gRPC tells of headers and of the first answer in any order: the answer waits for the headers.
  void OnReadInitialMetadataDone(bool ok) override {
    std::optional<bool> early;
    {
      const std::lock_guard lock(mutex_);
      has_headers_ = true;
      if (ok) client_ = RoomOf(context_.GetServerInitialMetadata());
      early = early_read_;
    }
    if (early) TakeIn(*early);
  }
  void OnReadDone(bool ok) override {
    {
      const std::lock_guard lock(mutex_);
      if (!has_headers_) {
        early_read_ = ok;
        return;
      }
    }
    TakeIn(ok);
  }
  // Counts now, not on the strand: answers must not pile up while the strand is busy.
  void TakeIn(bool ok) {
    if (ok)
      held_ = HeldRoom(unread_, client_.value_or(""), kCopies * static_cast<int64_t>(in_.Length()));
    Note(&read, ok);
  }
  void OnDone(const grpc::Status& final_status) override {
    const asio::any_io_executor executor = executor_;  // this may be gone before post() returns
    asio::post(executor, [self = std::move(self_), final_status] {
      self->status = final_status;
      self->done = {true, true, true};
      self->timer_.cancel();
    });
  }

  void Note(Step* step, bool ok) {
    const asio::any_io_executor executor = executor_;
    asio::post(executor, [self = shared_from_this(), step, ok] {
      step->over = true;
      step->ok = ok;
      self->timer_.cancel();
    });
  }

  const asio::any_io_executor executor_;  // does not run out of work while this is there
  asio::steady_timer timer_;
  const std::function<bool()> gone_;
  SharedRoom* const unread_;
  std::mutex mutex_;
  bool has_headers_ = false;           // or will never have any
  std::optional<std::string> client_;  // whose room the answers take, once the call was let in
  std::optional<bool> early_read_;     // the first read was over before the headers were there
  HeldRoom held_;                  // gRPC's while a read is begun and not over, else the strand's
  std::shared_ptr<Reactor> self_;  // until gRPC is done with it
  grpc::ClientContext context_;
  grpc::ByteBuffer in_, out_;
  bool let_go_ = false;
};

RpcCall::RpcCall(grpc::GenericStub* stub, std::string_view method,
                 const std::multimap<std::string, std::string>& metadata,
                 asio::any_io_executor executor, std::function<bool()> gone, SharedRoom* unread)
    : reactor_(std::make_shared<Reactor>(std::move(executor), std::move(gone), unread)) {
  reactor_->Start(stub, method, metadata);
}

RpcCall::~RpcCall() {
  if (!reactor_->done.over) reactor_->Cancel();
  reactor_->LetGo();
}

asio::awaitable<bool> RpcCall::Write(const google::protobuf::Message& request) {
  reactor_->BeginWrite(BytesOf(request), /*last=*/false);
  co_await reactor_->Wait(reactor_->write);
  co_return reactor_->write.ok;
}

asio::awaitable<bool> RpcCall::WriteLast(const google::protobuf::Message& request) {
  reactor_->BeginWrite(BytesOf(request), /*last=*/true);
  co_await reactor_->Wait(reactor_->write);
  co_return reactor_->write.ok;
}

asio::awaitable<RpcCall::Got> RpcCall::Read(google::protobuf::Message* answer, double seconds) {
  reactor_->BeginRead();
  const bool over = co_await reactor_->Wait(reactor_->read, seconds);
  if (!over) co_return Got::kNothingYet;
  const bool ok = reactor_->read.ok;
  grpc::ByteBuffer bytes = reactor_->TakeRead();
  if (!ok) co_return Got::kEnd;
  grpc::ProtoBufferReader reader(&bytes);
  if (!answer->ParseFromZeroCopyStream(&reader)) {
    reactor_->Cancel();
    co_return Got::kEnd;
  }
  co_return Got::kMessage;
}

bool RpcCall::let_in() const { return reactor_->let_in(); }

HeldRoom RpcCall::TakeHeld() { return reactor_->TakeHeld(); }

asio::awaitable<grpc::Status> RpcCall::Finish() {
  reactor_->LetGo();
  co_await reactor_->Wait(reactor_->done);
  co_return reactor_->status;
}

}  // namespace litags::web
