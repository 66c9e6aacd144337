// A job store that is another one: tests override what they want to go wrong.
#ifndef LITAGS_SERVER_TESTING_FORWARDING_JOB_STORE_H_
#define LITAGS_SERVER_TESTING_FORWARDING_JOB_STORE_H_

#include <optional>
#include <string>
#include <vector>

#include "server/store/job_store.h"

namespace litags {

class ForwardingJobStore : public JobStore {
 public:
  // `store` must outlive this.
  explicit ForwardingJobStore(JobStore* store) : store_(*store) {}

  absl::StatusOr<JobRecord> Create(const JobRecord& job, Change change) override {
    return store_.Create(job, change);
  }
  absl::StatusOr<JobRecord> Get(std::string_view id) override { return store_.Get(id); }
  absl::StatusOr<std::optional<JobRecord>> FindRequest(const std::string& owner,
                                                       const std::string& request_id) override {
    return store_.FindRequest(owner, request_id);
  }
  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit, const std::optional<std::string>& owner,
                                              ListOrder order) override {
    return store_.List(after_time_ms, after_id, limit, owner, order);
  }
  absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override {
    return store_.Update(id, change);
  }
  absl::StatusOr<std::optional<JobRecord>> UpdateFirstQueued(Fits fits, Change change) override {
    return store_.UpdateFirstQueued(fits, change);
  }
  absl::StatusOr<std::optional<JobRecord>> UpdateFirstExpired(int64_t now_ms,
                                                              Change change) override {
    return store_.UpdateFirstExpired(now_ms, change);
  }
  absl::StatusOr<std::optional<JobRecord>> UpdateFirstLeasedBeyond(int64_t latest_ms,
                                                                   Change change) override {
    return store_.UpdateFirstLeasedBeyond(latest_ms, change);
  }
  absl::StatusOr<std::vector<std::string>> LeasedTo(std::string_view owner) override {
    return store_.LeasedTo(owner);
  }
  absl::StatusOr<std::vector<std::string>> Expired(int64_t now_ms, int limit) override {
    return store_.Expired(now_ms, limit);
  }
  absl::StatusOr<std::vector<std::string>> WebhooksDue(int64_t now_ms, int64_t latest_ms,
                                                       int limit) override {
    return store_.WebhooksDue(now_ms, latest_ms, limit);
  }
  absl::StatusOr<std::vector<std::string>> JobsWithUnreferencedBlobs(int limit) override {
    return store_.JobsWithUnreferencedBlobs(limit);
  }
  absl::StatusOr<JobCensus> Census() override { return store_.Census(); }
  absl::StatusOr<JobQueue> Queue() override { return store_.Queue(); }
  absl::Status PutWorker(const WorkerRecord& worker) override { return store_.PutWorker(worker); }
  absl::Status RemoveWorker(std::string_view name) override { return store_.RemoveWorker(name); }
  absl::StatusOr<std::vector<WorkerRecord>> Workers(int64_t since_ms) override {
    return store_.Workers(since_ms);
  }
  absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) override {
    return store_.Files(id);
  }
  absl::StatusOr<std::optional<FileRecord>> File(std::string_view id, FileRole role,
                                                 std::string_view name) override {
    return store_.File(id, role, name);
  }
  absl::StatusOr<FileTally> Tally(std::string_view id, std::string_view sha256) override {
    return store_.Tally(id, sha256);
  }
  absl::StatusOr<std::optional<JobFile>> FindFile(std::string_view id, FileRole role,
                                                  std::string_view sha256) override {
    return store_.FindFile(id, role, sha256);
  }
  absl::StatusOr<OwnerUsage> UsageOf(std::string_view owner) override {
    return store_.UsageOf(owner);
  }
  absl::StatusOr<std::vector<std::string>> Uploading(std::string_view owner) override {
    return store_.Uploading(owner);
  }
  absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after,
                                                  int limit) override {
    return store_.Events(id, after, limit);
  }
  absl::StatusOr<std::vector<LogEntry>> Log(std::string_view id, int64_t after,
                                            int limit) override {
    return store_.Log(id, after, limit);
  }
  absl::StatusOr<int64_t> WaitForChange(ChangeTopic topic, int64_t seen, double seconds) override {
    return store_.WaitForChange(topic, seen, seconds);
  }
  absl::StatusOr<std::string> InstallationId() override { return store_.InstallationId(); }
  absl::Status CheckWritable() override { return store_.CheckWritable(); }
  int64_t NowMs() override { return store_.NowMs(); }
  int64_t ReachableSinceMs() override { return store_.ReachableSinceMs(); }

 private:
  JobStore& store_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_FORWARDING_JOB_STORE_H_
