// JobStore on any SQL database. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQL_JOB_STORE_H_
#define LITAGS_SERVER_STORE_SQL_JOB_STORE_H_

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/error.h"
#include "server/store/job_store.h"
#include "server/store/sql.h"
#include "server/store/sql_jobs.h"

namespace litags {

// What is the same for every database. A subclass brings connections and transactions, and says how
// its clock is read and its changes are waited for.
class SqlJobStore : public JobStore {
 public:
  absl::StatusOr<JobRecord> Create(const JobRecord& job, Change change) override;
  absl::StatusOr<JobRecord> Get(std::string_view id) override;
  absl::StatusOr<std::optional<JobRecord>> FindRequest(const std::string& owner,
                                                       const std::string& request_id) override;
  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit, const std::optional<std::string>& owner,
                                              ListOrder order) override;
  absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override;
  absl::StatusOr<std::optional<JobRecord>> UpdateFirstQueued(Fits fits, Change change) override;
  absl::StatusOr<std::optional<JobRecord>> UpdateFirstExpired(int64_t now_ms,
                                                              Change change) override;
  absl::StatusOr<std::optional<JobRecord>> UpdateFirstLeasedBeyond(int64_t latest_ms,
                                                                   Change change) override;
  absl::StatusOr<std::vector<std::string>> LeasedTo(std::string_view owner) override;
  absl::StatusOr<std::vector<std::string>> Expired(int64_t now_ms, int limit) override;
  absl::StatusOr<std::vector<std::string>> WebhooksDue(int64_t now_ms, int64_t latest_ms,
                                                       int limit) override;
  absl::StatusOr<std::vector<std::string>> JobsWithUnreferencedBlobs(int limit) override;
  absl::StatusOr<JobCensus> Census() override;
  absl::StatusOr<JobQueue> Queue() override;
  absl::StatusOr<OwnerUsage> UsageOf(std::string_view owner) override;
  absl::StatusOr<std::vector<std::string>> Uploading(std::string_view owner) override;
  absl::Status PutWorker(const WorkerRecord& worker) override;
  absl::Status RemoveWorker(std::string_view name) override;
  absl::StatusOr<std::vector<WorkerRecord>> Workers(int64_t since_ms) override;
  absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) override;
  absl::StatusOr<std::optional<FileRecord>> File(std::string_view id, FileRole role,
                                                 std::string_view name) override;
  absl::StatusOr<FileTally> Tally(std::string_view id, std::string_view sha256) override;
  absl::StatusOr<std::optional<JobFile>> FindFile(std::string_view id, FileRole role,
                                                  std::string_view sha256) override;
  absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after,
                                                  int limit) override;
  absl::StatusOr<std::vector<LogEntry>> Log(std::string_view id, int64_t after, int limit) override;
  absl::StatusOr<std::string> InstallationId() override;

 protected:
  // How a SELECT in a transaction keeps others from its row, and how it passes over rows that
  // others keep; empty where transactions run one after the other.
  SqlJobStore(const char* lock, const char* lock_or_skip)
      : lock_(lock), lock_or_skip_(lock_or_skip) {}

  // Runs `work` on a session that sees what is committed. Both may call `work` again after an error
  // of the database that another try can cure, and return its error otherwise.
  using ReadWork = absl::FunctionRef<absl::Status(SqlSession&)>;
  virtual absl::Status Read(ReadWork work) = 0;
  // Runs `work` in a transaction: committed if it returns true, else rolled back.
  using WriteWork = absl::FunctionRef<absl::StatusOr<bool>(SqlSession&)>;
  virtual absl::Status Write(WriteWork work) = 0;

 private:
  // What `select(sql)` says.
  template <typename Select>
  std::invoke_result_t<Select, SqlSession&> Answer(Select select) {
    std::invoke_result_t<Select, SqlSession&> answer;
    LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) {
      answer = select(sql);
      return answer.status();
    }));
    return answer;
  }
  // The same, of a job that must be there.
  template <typename Select>
  std::invoke_result_t<Select, SqlSession&> AnswerOf(std::string_view id, Select select) {
    return Answer([&](SqlSession& sql) -> std::invoke_result_t<Select, SqlSession&> {
      LITAGS_RETURN_IF_ERROR(SelectJob(sql, id).status());
      return select(sql);
    });
  }

  // Update() of the job whose id `select(sql, lock)` finds.
  using Select = absl::FunctionRef<absl::StatusOr<std::optional<std::string>>(
      SqlSession&, std::string_view lock)>;
  absl::StatusOr<std::optional<JobRecord>> UpdateFirst(Select select, Change change);

  const char* const lock_;
  const char* const lock_or_skip_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQL_JOB_STORE_H_
