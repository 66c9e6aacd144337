#include "server/api/upload_reactor.h"

#include <chrono>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/grpc_order.h"
#include "server/api/status.h"

namespace litags {
namespace {

absl::Status Stalled(double seconds) {
  return MakeError(absl::StatusCode::kDeadlineExceeded, "UPLOAD_STALLED", "",
                   absl::StrCat("nothing came for ", seconds,
                                " s; what came before is kept: ask QueryUpload and send the rest"));
}

}  // namespace

UploadReactor::UploadReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
                             v1::UploadImagesResponse* response, ThreadPool* pool)
    : call_(std::move(call)),
      context_(context),
      response_(response),
      pool_(pool),
      session_(call_->jobs()) {
  Read();
}

void UploadReactor::Read() {
  {
    std::lock_guard lock(awaited_->mutex);
    awaited_->read = ++reads_;
  }
  const double seconds = call_->jobs()->uploads().limits().max_silence_seconds;
  const auto deadline = std::chrono::system_clock::now() +
                        std::chrono::milliseconds(static_cast<int64_t>(1000 * seconds));
  alarm_ = std::make_unique<grpc::Alarm>();
  alarm_->Set(deadline, [this, seconds, awaited = awaited_, read = reads_](bool due) {
    if (!due) return;  // set off by its end; `this` may be gone
    {
      std::lock_guard lock(awaited->mutex);
      if (awaited->read != read) return;
      awaited->read = Awaited::kStalled;
    }
    Finish(call_->End(Stalled(seconds)));  // only whoever ends the wait for a read may go on
  });
  BeforeStart(this);
  StartRead(&request_);
}

void UploadReactor::OnReadDone(bool ok) {
  AfterStart(this);
  {
    std::lock_guard lock(awaited_->mutex);
    if (awaited_->read == Awaited::kStalled) return;
    awaited_->read = Awaited::kNone;
  }
  pool_->Run([this, ok] { Step(ok); });
}

void UploadReactor::Step(bool ok) {
  alarm_.reset();
  if (context_->IsCancelled()) return Finish(call_->End(CallCancelled()));
  call_->metrics().AddUploadedBytes(static_cast<int64_t>(ok ? request_.chunk().size() : 0));
  const absl::Status status = ok ? session_.Handle(request_) : session_.End(response_);
  if (ok && status.ok()) return Read();
  Finish(call_->End(status));
}

}  // namespace litags
