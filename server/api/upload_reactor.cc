#include "server/api/upload_reactor.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/grpc_order.h"
#include "server/api/status.h"

namespace litags {
namespace {

// How soon a client that hung up is noticed.
constexpr double kMaxPauseSeconds = 1;

absl::Status Stalled(double seconds) {
  return MakeError(absl::StatusCode::kDeadlineExceeded, "UPLOAD_STALLED", "",
                   absl::StrCat("nothing came for ", seconds,
                                " s; what came before is kept: ask QueryUpload and send the rest"));
}

}  // namespace

UploadReactor::UploadReactor(std::shared_ptr<Call> call, v1::UploadImagesResponse* response,
                             ThreadPool* pool, CpuBudget* budget)
    : call_(std::move(call)),
      response_(response),
      pool_(pool),
      budget_(budget),
      session_(call_->jobs(), cancel_) {
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
  call_->metrics().AddUploadedBytes(static_cast<int64_t>(ok ? request_.chunk().size() : 0));
  Queue(ok);
}

void UploadReactor::Queue(bool ok) {
  pool_->Run(call_->client().name, [this, ok] { Step(ok); });
}

void UploadReactor::Step(bool ok) {
  if (cancel_.IsCancelled()) return Finish(call_->End(CallCancelled()));
  const std::string& client = call_->client().name;
  if (const double pause = budget_->SecondsToWait(client); pause > 0) {
    return timer_.Start(std::min(pause, kMaxPauseSeconds), [this, ok] { Queue(ok); });
  }
  const double before = ThreadCpuSeconds();
  const absl::Status status = session_.busy() ? session_.Continue()
                              : ok            ? session_.Handle(request_)
                                              : session_.End(response_);
  budget_->Spend(client, ThreadCpuSeconds() - before);
  if (!status.ok()) {
    return Finish(call_->End(absl::IsCancelled(status) ? CallCancelled() : status));
  }
  if (session_.busy()) return Queue(ok);
  if (ok) return Read();
  Finish(call_->End(status));
}

}  // namespace litags
