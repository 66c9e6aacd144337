// The statements about jobs, their events and logs, in the SQL that SQLite and PostgreSQL share.
// Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQL_JOBS_H_
#define LITAGS_SERVER_STORE_SQL_JOBS_H_

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/job_store.h"
#include "server/store/sql.h"

namespace litags {

// `lock` ends a SELECT that is to keep others from the row: "", " FOR UPDATE".
absl::StatusOr<JobRecord> SelectJob(SqlSession& sql, std::string_view id,
                                    std::string_view lock = "");
absl::StatusOr<std::optional<JobRecord>> SelectByRequest(SqlSession& sql, const std::string& owner,
                                                         const std::string& request_id);
absl::StatusOr<std::vector<JobRecord>> SelectPage(SqlSession& sql, int64_t after_time_ms,
                                                  std::string_view after_id, int limit,
                                                  const std::optional<std::string>& owner,
                                                  ListOrder order);

// Which running job of several is to be changed, by the end of its lease.
enum class FirstOf { kExpired, kLeasedBeyond };
absl::StatusOr<std::optional<std::string>> SelectFirst(SqlSession& sql, FirstOf which,
                                                       int64_t time_ms, std::string_view lock);

absl::StatusOr<std::vector<std::string>> SelectLeasedTo(SqlSession& sql, std::string_view owner);
absl::StatusOr<std::vector<std::string>> SelectExpired(SqlSession& sql, int64_t now_ms, int limit);
absl::StatusOr<std::vector<std::string>> SelectWebhooksDue(SqlSession& sql, int64_t now_ms,
                                                           int64_t latest_ms, int limit);
absl::StatusOr<std::vector<std::string>> SelectJobsWithUnreferencedBlobs(SqlSession& sql,
                                                                         int limit);
absl::StatusOr<JobCensus> SelectCensus(SqlSession& sql);
absl::StatusOr<JobQueue> SelectQueue(SqlSession& sql);
// Of all the owner's jobs but `but`.
absl::StatusOr<OwnerUsage> SelectUsage(SqlSession& sql, std::string_view owner,
                                       std::string_view but);
absl::StatusOr<std::vector<std::string>> SelectUploading(SqlSession& sql, std::string_view owner);
absl::StatusOr<std::vector<EventRecord>> SelectEvents(SqlSession& sql, std::string_view id,
                                                      int64_t after, int limit);
absl::StatusOr<std::vector<LogEntry>> SelectLog(SqlSession& sql, std::string_view id, int64_t after,
                                                int limit);

// False: the owner has a job of the same request_id.
absl::StatusOr<bool> InsertJob(SqlSession& sql, const JobRecord& job);

// Inserts `id` if the store has none. Returns the one that it has.
absl::StatusOr<std::string> InsertInstallation(SqlSession& sql, std::string_view id);

// Applies `change` to the job, whose row the session's transaction holds, and writes it back.
absl::StatusOr<JobRecord> ApplyChange(SqlSession& sql, JobRecord job, JobStore::Change change);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQL_JOBS_H_
