#ifndef LITAGS_SERVER_JOBS_CLIENT_JOB_STORE_H_
#define LITAGS_SERVER_JOBS_CLIENT_JOB_STORE_H_

#include <optional>
#include <string>
#include <vector>

#include "server/jobs/caps.h"
#include "server/store/job_store.h"

namespace litags {

// Whose jobs, and how many of them.
struct ClientView {
  std::string owner;      // of the jobs it makes
  bool sees_all = false;  // also other owners' jobs: an administrator
  int64_t max_jobs = 0;   // of this owner at one time; 0: no limit
  int64_t max_bytes = 0;  // of all that they hold, see OwnerUsage; 0: no limit
  JobCaps caps = {};      // of each job
};

// RESOURCE_EXHAUSTED (BYTE_QUOTA_REACHED) if there is a limit, and `bytes` are more.
absl::Status CheckByteQuota(int64_t bytes, int64_t max_bytes);

// The store as one client may use it. Jobs of others are as good as not there, in every call: this
// is the one place where ownership and quotas are checked, below all handlers, so that a new
// handler cannot forget them.
//
// Errors beside the store's: RESOURCE_EXHAUSTED (JOB_QUOTA_REACHED, BYTE_QUOTA_REACHED).
class ClientJobStore : public ClientStore {
 public:
  // `store` must outlive this.
  ClientJobStore(ClientStore* store, ClientView view) : store_(store), view_(std::move(view)) {}

  absl::StatusOr<JobRecord> Create(const JobRecord& job, Change change) override;
  absl::StatusOr<JobRecord> Get(std::string_view id) override;
  absl::StatusOr<std::optional<JobRecord>> FindRequest(const std::string& owner,
                                                       const std::string& request_id) override;
  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit, const std::optional<std::string>& owner,
                                              ListOrder order) override;
  absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override;
  absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) override;
  absl::StatusOr<std::optional<FileRecord>> File(std::string_view id, FileRole role,
                                                 std::string_view name) override;
  absl::StatusOr<FileTally> Tally(std::string_view id, std::string_view sha256) override;
  absl::StatusOr<std::optional<JobFile>> FindFile(std::string_view id, FileRole role,
                                                  std::string_view sha256) override;
  absl::StatusOr<OwnerUsage> UsageOf(std::string_view owner) override;
  absl::StatusOr<std::vector<std::string>> Uploading(std::string_view owner) override;
  absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after,
                                                  int limit) override;
  absl::StatusOr<std::vector<LogEntry>> Log(std::string_view id, int64_t after, int limit) override;
  absl::StatusOr<int64_t> WaitForChange(ChangeTopic topic, int64_t seen, double seconds) override {
    return store_->WaitForChange(topic, seen, seconds);
  }
  absl::StatusOr<std::vector<WorkerRecord>> Workers(int64_t since_ms) override {
    return store_->Workers(since_ms);
  }
  // Of all clients: whoever reads it must show no client another's.
  absl::StatusOr<JobQueue> Queue() override { return store_->Queue(); }
  absl::Status CheckWritable() override { return store_->CheckWritable(); }
  int64_t NowMs() override { return store_->NowMs(); }
  int64_t ReachableSinceMs() override { return store_->ReachableSinceMs(); }

 private:
  bool Sees(const JobRecord& job) const { return view_.sees_all || job.owner == view_.owner; }

  ClientStore* const store_;
  const ClientView view_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_CLIENT_JOB_STORE_H_
