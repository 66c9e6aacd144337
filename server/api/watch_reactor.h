#ifndef LITAGS_SERVER_API_WATCH_REACTOR_H_
#define LITAGS_SERVER_API_WATCH_REACTOR_H_

#include <memory>
#include <string>
#include <vector>

#include "litags/v1/reconstruction_service.pb.h"
#include "server/api/follow_stream.h"

namespace litags {

// One WatchJob stream. Previews are left out while clients have too much unread.
class WatchReactor : public FollowStream<EventRecord, v1::JobEvent> {
 public:
  WatchReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
               const v1::WatchJobRequest& request, EventHub* hub, ThreadPool* pool);

 private:
  absl::StatusOr<int64_t> First(const JobRecord& job) override;
  absl::StatusOr<std::vector<EventRecord>> Read(const std::string& job_id, int64_t after) override;
  absl::StatusOr<v1::JobEvent> Fill(const std::string& job_id, const EventRecord& event) override;
  bool IsOver(const JobRecord& job, int64_t last) const override;

  const v1::WatchJobRequest& request_;  // gRPC's, which outlives this
};

// One GetLog stream.
class LogReactor : public FollowStream<LogEntry, v1::LogEntry> {
 public:
  LogReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
             const v1::GetLogRequest& request, EventHub* hub, ThreadPool* pool);

 private:
  absl::StatusOr<int64_t> First(const JobRecord& job) override;
  absl::StatusOr<std::vector<LogEntry>> Read(const std::string& job_id, int64_t after) override;
  absl::StatusOr<v1::LogEntry> Fill(const std::string& job_id, const LogEntry& entry) override;
  bool IsOver(const JobRecord& job, int64_t last) const override;

  const v1::GetLogRequest& request_;  // gRPC's, which outlives this
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_WATCH_REACTOR_H_
