#ifndef LITAGS_SERVER_API_WATCH_REACTOR_H_
#define LITAGS_SERVER_API_WATCH_REACTOR_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <deque>
#include <mutex>
#include <string>

#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "server/api/event_hub.h"
#include "server/api/gate.h"
#include "server/api/stall_timer.h"
#include "server/api/thread_pool.h"
#include "server/jobs/jobs.h"

namespace litags {

// One WatchJob stream. Reads a few events from the store whenever the last ones were sent, so a
// slow reader costs a few events of memory, and none is lost or doubled: what to read next follows
// from the number sent last. Previews are left out while clients have too much unread. A client
// that does not take an event for too long is cut off. Deletes itself when the call is over.
class WatchReactor : public grpc::ServerWriteReactor<v1::JobEvent> {
 public:
  WatchReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
               const v1::WatchJobRequest& request, EventHub* hub, ThreadPool* pool);

  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

 private:
  // Sends the next event, or ends the call, or goes to sleep until woken. At most one runs.
  void Step();
  void Wake();
  void End(const absl::Status& status);
  absl::Status ReadMore(bool* over);
  absl::StatusOr<v1::JobEvent> Fill(const EventRecord& event);

  const std::shared_ptr<Call> call_;
  grpc::CallbackServerContext* const context_;
  const v1::WatchJobRequest request_;
  Jobs* const jobs_;
  EventHub* const hub_;
  ThreadPool* const pool_;
  int64_t subscription_ = 0;
  TokenWatch::Ticket ticket_;

  std::mutex mutex_;
  bool awake_ = true;     // Step() runs or is about to, or a write is in flight
  bool changed_ = false;  // since the store was last read
  bool ended_ = false;

  // Used by Step() only.
  bool started_ = false;
  std::string job_id_;
  int64_t last_ = 0;  // number of the event sent last
  std::deque<EventRecord> ready_;
  v1::JobEvent message_;
  StallTimer timer_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_WATCH_REACTOR_H_
