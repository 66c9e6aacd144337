#include "server/api/upload_reactor.h"

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

UploadReactor::UploadReactor(std::shared_ptr<Call> call, v1::UploadImagesResponse* response,
                             ThreadPool* pool, FileReader* reader)
    : call_(std::move(call)),
      response_(response),
      pool_(pool),
      session_(call_->jobs(), reader, cancel_) {
  Read();
}

void UploadReactor::Read() {
  const double seconds = call_->jobs()->uploads().limits().max_silence_seconds;
  timer_.Start(seconds, [this, seconds] { Finish(call_->End(Stalled(seconds))); });
  BeforeStart(this);
  StartRead(&request_);
}

void UploadReactor::OnReadDone(bool ok) {
  AfterStart(this);
  if (timer_.Stop()) return;  // finished
  pool_->Run(call_->client().name, [this, ok] { Step(ok); });
}

void UploadReactor::Step(bool ok) {
  if (cancel_.IsCancelled()) return Finish(call_->End(CallCancelled()));
  call_->metrics().AddUploadedBytes(static_cast<int64_t>(ok ? request_.chunk().size() : 0));
  const absl::Status status = ok ? session_.Handle(request_) : session_.End(response_);
  if (ok && status.ok()) return Read();
  Finish(call_->End(absl::IsCancelled(status) ? CallCancelled() : status));
}

}  // namespace litags
