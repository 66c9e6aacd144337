#ifndef LITAGS_SERVER_API_FOLLOW_STREAM_H_
#define LITAGS_SERVER_API_FOLLOW_STREAM_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <cstdint>
#include <deque>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/error.h"
#include "server/api/cut_off.h"
#include "server/api/event_hub.h"
#include "server/api/gate.h"
#include "server/api/grpc_order.h"
#include "server/api/stall_timer.h"
#include "server/api/status.h"
#include "server/api/thread_pool.h"

namespace litags {

// A stream of a job's numbered records, those that are there and each new one. Reads a few from the
// store whenever the last ones were sent, so a slow reader costs a few records of memory, and none
// is lost or doubled: what to read next follows from the number sent last. A client that does not
// take one for too long is cut off. Deletes itself when the call is over.
template <typename Record, typename Message>
class FollowStream : public grpc::ServerWriteReactor<Message> {
 public:
  void OnWriteDone(bool ok) final {
    AfterStart(this);
    const bool stalled = timer_.Stop();
    call_->Hold(0);
    if (stalled) return End(AnswerNotRead());
    if (!ok) return End(CallCancelled());
    Run();
  }

  void OnCancel() final { Wake(); }

  void OnDone() final {
    hub_->Unsubscribe(subscription_);
    ticket_ = {};
    delete this;
  }

 protected:
  static constexpr int kRecordsPerRead = 16;

  FollowStream(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
               const std::string& job_name, EventHub* hub, ThreadPool* pool)
      : call_(std::move(call)), context_(context), job_name_(job_name), hub_(hub), pool_(pool) {}

  // To be called last in the constructor.
  void Begin() {
    subscription_ = hub_->Subscribe([this] { Wake(); });
    ticket_ = call_->WatchToken([this] { Wake(); });
    Run();
  }

  // The number after which to begin; its error if the job has not come so far.
  virtual absl::StatusOr<int64_t> First(const JobRecord& job) = 0;
  // Records with numbers above `after`, in order, kRecordsPerRead at most.
  virtual absl::StatusOr<std::vector<Record>> Read(const std::string& job_id, int64_t after) = 0;
  virtual absl::StatusOr<Message> Fill(const std::string& job_id, const Record& record) = 0;
  // Whether nothing more will be sent, once the record `last` was.
  virtual bool IsOver(const JobRecord& job, int64_t last) const = 0;

  Jobs& jobs() const { return *call_->jobs(); }
  Call& call() const { return *call_; }

 private:
  void Run() {
    pool_->Run(call_->client().name, [this] { Step(); });
  }

  void Wake() {
    std::lock_guard lock(mutex_);
    changed_ = true;
    if (awake_ || ended_) return;
    awake_ = true;
    Run();
  }

  void End(const absl::Status& status) {
    {
      std::lock_guard lock(mutex_);
      ended_ = true;
    }
    this->Finish(call_->End(status));
  }

  // Sends the next record, or ends the call, or goes to sleep until woken. At most one runs.
  void Step() {
    for (;;) {
      if (context_->IsCancelled()) return End(CallCancelled());
      if (const absl::Status known = call_->CheckToken(); !known.ok()) return End(known);
      if (!ready_.empty()) return SendFirst();
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

  void SendFirst() {
    auto message = Fill(job_id_, ready_.front());
    if (!message.ok()) return End(message.status());
    last_ = ready_.front().number;
    ready_.pop_front();
    message_ = *std::move(message);
    call_->Hold(static_cast<int64_t>(message_.ByteSizeLong()));
    timer_.Start(call_->SecondsToRead(), [this] { CutOff(context_); });
    BeforeStart(this);
    this->StartWrite(&message_);
  }

  absl::Status ReadMore(bool* over) {
    if (job_id_.empty()) {
      LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(job_name_));
      LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs().Get(id));
      LITAGS_ASSIGN_OR_RETURN(last_, First(job));
      job_id_ = id;
    }
    LITAGS_ASSIGN_OR_RETURN(auto records, Read(job_id_, last_));
    ready_.assign(std::make_move_iterator(records.begin()), std::make_move_iterator(records.end()));
    if (!ready_.empty()) return absl::OkStatus();
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs().Get(job_id_));
    // A record may have come between the two reads; then its change wakes us again.
    *over = IsOver(job, last_);
    return absl::OkStatus();
  }

  const std::shared_ptr<Call> call_;
  grpc::CallbackServerContext* const context_;
  const std::string& job_name_;  // in the request
  EventHub* const hub_;
  ThreadPool* const pool_;
  int64_t subscription_ = 0;
  TokenWatch::Ticket ticket_;

  std::mutex mutex_;
  bool awake_ = true;     // Step() runs or is about to, or a write is in flight
  bool changed_ = false;  // since the store was last read
  bool ended_ = false;

  // Used by Step() only.
  std::string job_id_;  // once First() was asked
  int64_t last_ = 0;    // number of the record sent last
  std::deque<Record> ready_;
  Message message_;
  StallTimer timer_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_FOLLOW_STREAM_H_
