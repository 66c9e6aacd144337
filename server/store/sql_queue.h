// Which job leaves the queue next, and who is there to take it. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQL_QUEUE_H_
#define LITAGS_SERVER_STORE_SQL_QUEUE_H_

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/job_store.h"
#include "server/store/sql.h"

namespace litags {

// The job that JobStore::UpdateFirstQueued() is about. `lock` ends the SELECT that takes it, so
// that it passes over jobs that others are taking.
//
// Costs some index look-ups for each pair of needs and owner that has jobs of the priority in the
// queue, however many jobs each has.
absl::StatusOr<std::optional<std::string>> SelectQueued(SqlSession& sql, JobStore::Fits fits,
                                                        std::string_view lock);

// The workers that said they are there. Those that died without a word a day ago are forgotten when
// another one is seen.
absl::Status UpsertWorker(SqlSession& sql, const WorkerRecord& worker);
absl::Status DeleteWorker(SqlSession& sql, std::string_view name);
absl::StatusOr<std::vector<WorkerRecord>> SelectWorkers(SqlSession& sql, int64_t since_ms);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQL_QUEUE_H_
