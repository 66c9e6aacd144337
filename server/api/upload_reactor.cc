#include "server/api/upload_reactor.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/grpc_order.h"
#include "server/api/status.h"

namespace litags {
namespace {

using Message = google::protobuf::MessageLite;

// How soon a client that hung up is noticed.
constexpr double kMaxPauseSeconds = 1;

absl::Status Stalled(double seconds) {
  return MakeError(absl::StatusCode::kDeadlineExceeded, "UPLOAD_STALLED", "",
                   absl::StrCat("nothing came for ", seconds,
                                " s; what came before is kept: ask QueryUpload and send the rest"));
}

}  // namespace

UploadReactor::UploadReactor(std::shared_ptr<Call> call, grpc::ByteBuffer* response,
                             const UploadResources& shared)
    : call_(std::move(call)),
      response_(response),
      shared_(shared),
      session_(call_->jobs(), shared.reader, cancel_) {
  ticket_ = call_->WatchToken([this] {
    const absl::Status known = call_->CheckToken();
    if (known.ok() || !StopWaiting()) return;  // Step() finds it out
    shared_.pool->Run(call_->client().name, [this, known] { Finish(call_->End(known)); });
  });
  Read();
}

void UploadReactor::Read() {
  const double seconds = call_->jobs()->uploads().limits().max_silence_seconds;
  timer_.Start(seconds, [this, seconds] {
    if (StopWaiting()) Finish(call_->End(Stalled(seconds)));
  });
  std::unique_lock lock(mutex_);  // nobody may finish before the read has begun
  const absl::Status known = call_->CheckToken();
  if (known.ok()) {
    waiting_ = true;
    BeforeStart(this);
    StartRead(&bytes_);
    return;
  }
  lock.unlock();
  Finish(call_->End(known));
}

bool UploadReactor::StopWaiting() {
  std::lock_guard lock(mutex_);
  return std::exchange(waiting_, false);
}

void UploadReactor::OnReadDone(bool ok) {
  AfterStart(this);
  timer_.Stop();
  if (ok) waiting_bytes_ = static_cast<int64_t>(bytes_.Length());
  if (!StopWaiting()) return;  // finished
  Queue(ok);
}

void UploadReactor::Queue(bool ok) {
  shared_.pool->Run(call_->client().name, [this, ok] { Step(ok); });
}

void UploadReactor::Step(bool ok) {
  if (cancel_.IsCancelled()) return Finish(call_->End(CallCancelled()));
  if (const absl::Status known = call_->CheckToken(); !known.ok()) {
    return Finish(call_->End(known));
  }
  if (const double pause = SecondsToWait(); pause > 0) {
    return timer_.Start(std::min(pause, kMaxPauseSeconds), [this, ok] { Queue(ok); });
  }
  const double before = ThreadCpuSeconds();
  const absl::Status status = session_.busy() ? session_.Continue() : ok ? Take() : Complete();
  // While another process reads a file, it takes the processor and this thread waits.
  shared_.cpu->Spend(call_->client().name,
                     std::max(ThreadCpuSeconds() - before, session_.TakeReadingSeconds()));
  CountArchive(session_.unpacks());
  CountRead();
  if (!status.ok()) {
    return Finish(call_->End(absl::IsCancelled(status) ? CallCancelled() : status));
  }
  if (session_.busy()) return Queue(ok);
  if (ok) return Read();
  Finish(call_->End(status));
}

double UploadReactor::SecondsToWait() const {
  const std::string& client = call_->client().name;
  if (session_.wants_to_unpack() && !shared_.archives->IsFor(client)) return kMaxPauseSeconds;
  return shared_.cpu->SecondsToWait(client);
}

void UploadReactor::CountArchive(bool unpacks) {
  if (unpacks == archive_counted_) return;
  archive_counted_ = unpacks;
  shared_.archives->Add(call_->client().name, unpacks ? 1 : -1);
}

void UploadReactor::CountRead() {
  if (waiting_bytes_ > 0) call_->CountRead(std::exchange(waiting_bytes_, 0));
}

absl::Status UploadReactor::Take() {
  v1::UploadImagesRequest request;  // gone when the stream waits for the next
  if (!grpc::SerializationTraits<Message>::Deserialize(&bytes_, &request).ok()) {
    return InvalidInput("MESSAGE_UNREADABLE", "",
                        "a message of the stream is not an UploadImagesRequest, or holds a text "
                        "that is not UTF-8, such as a file's name; what came before is kept");
  }
  call_->metrics().AddUploadedBytes(static_cast<int64_t>(request.chunk().size()));
  return session_.Handle(request);
}

absl::Status UploadReactor::Complete() {
  v1::UploadImagesResponse response;
  LITAGS_RETURN_IF_ERROR(session_.End(&response));
  bool own_buffer = false;
  const grpc::Status packed =
      grpc::SerializationTraits<Message>::Serialize(response, response_, &own_buffer);
  return packed.ok() ? absl::OkStatus() : absl::InternalError(packed.error_message());
}

}  // namespace litags
