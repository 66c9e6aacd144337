#include "server/api/watch_reactor.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/convert.h"
#include "server/api/cut_off.h"
#include "server/api/grpc_order.h"
#include "server/api/status.h"
#include "server/jobs/state_machine.h"

namespace litags {
namespace {

constexpr int kEventsPerRead = 16;

}  // namespace

WatchReactor::WatchReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
                           const v1::WatchJobRequest& request, EventHub* hub, ThreadPool* pool)
    : call_(std::move(call)),
      context_(context),
      request_(request),
      jobs_(call_->jobs()),
      hub_(hub),
      pool_(pool) {
  subscription_ = hub_->Subscribe([this] { Wake(); });
  ticket_ = call_->WatchToken([this] { Wake(); });
  pool_->Run(call_->client().name, [this] { Step(); });
}

void WatchReactor::Wake() {
  std::lock_guard lock(mutex_);
  changed_ = true;
  if (awake_ || ended_) return;
  awake_ = true;
  pool_->Run(call_->client().name, [this] { Step(); });
}

void WatchReactor::OnCancel() { Wake(); }

void WatchReactor::OnWriteDone(bool ok) {
  AfterStart(this);
  const bool stalled = timer_.Stop();
  call_->Hold(0);
  if (stalled) return End(AnswerNotRead());
  if (!ok) return End(CallCancelled());
  pool_->Run(call_->client().name, [this] { Step(); });
}

void WatchReactor::OnDone() {
  hub_->Unsubscribe(subscription_);
  ticket_ = {};
  delete this;
}

void WatchReactor::End(const absl::Status& status) {
  {
    std::lock_guard lock(mutex_);
    ended_ = true;
  }
  Finish(call_->End(status));
}

void WatchReactor::Step() {
  for (;;) {
    if (context_->IsCancelled()) return End(CallCancelled());
    if (const absl::Status known = call_->CheckToken(); !known.ok()) return End(known);
    if (!ready_.empty()) {
      auto message = Fill(ready_.front());
      if (!message.ok()) return End(message.status());
      last_ = ready_.front().number;
      ready_.pop_front();
      message_ = *std::move(message);
      call_->Hold(static_cast<int64_t>(message_.ByteSizeLong()));
      timer_.Start(call_->SecondsToRead(), [this] { CutOff(context_); });
      BeforeStart(this);
      return StartWrite(&message_);
    }
    {
      std::lock_guard lock(mutex_);
      changed_ = false;
    }
    bool over = false;
    if (const absl::Status status = ReadMore(&over); !status.ok()) return End(status);
    if (!ready_.empty()) continue;
    if (over) return End(absl::OkStatus());
    if (hub_->stopping()) return End(ShuttingDown());
    std::lock_guard lock(mutex_);
    if (changed_) continue;
    awake_ = false;
    return;
  }
}

absl::Status WatchReactor::ReadMore(bool* over) {
  if (!started_) {
    LITAGS_ASSIGN_OR_RETURN(job_id_, ParseJobName(request_.name()));
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs_->Get(job_id_));
    last_ = request_.after_event();
    if (last_ < 0) {
      return InvalidInput(
          "EVENT_NUMBER_INVALID", "after_event",
          absl::StrCat("after_event is ", last_, "; it is the number of an event, or 0 for all"));
    }
    if (last_ > job.last_event) {
      return MakeError(
          absl::StatusCode::kOutOfRange, "EVENT_NOT_YET", "after_event",
          absl::StrCat("after_event is ", last_, ", but the job's events go from 1 to ",
                       job.last_event, "; give the number of the last event seen"));
    }
    started_ = true;
  }
  LITAGS_ASSIGN_OR_RETURN(auto events, jobs_->Events(job_id_, last_, kEventsPerRead));
  ready_.assign(std::make_move_iterator(events.begin()), std::make_move_iterator(events.end()));
  if (ready_.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs_->Get(job_id_));
    // An event may have come between the two reads; then its change wakes us again.
    *over = IsTerminal(job.state) && job.last_event == last_;
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::JobEvent> WatchReactor::Fill(const EventRecord& event) {
  std::string preview;
  LITAGS_ASSIGN_OR_RETURN(v1::JobEvent message, EventToProto(event, &preview));
  if (request_.include_previews() && !preview.empty() && call_->CheckRoom().ok()) {
    LITAGS_ASSIGN_OR_RETURN(*message.mutable_progress()->mutable_preview_png(),
                            jobs_->Preview(job_id_, preview));
  }
  return message;
}

}  // namespace litags
