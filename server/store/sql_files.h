// The statements about jobs' files, in the SQL that SQLite and PostgreSQL share.
// Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQL_FILES_H_
#define LITAGS_SERVER_STORE_SQL_FILES_H_

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/job_store.h"
#include "server/store/sql.h"

namespace litags {

// `id`: of the job.
absl::StatusOr<std::vector<FileRecord>> SelectFiles(SqlSession& sql, std::string_view id);
absl::StatusOr<std::vector<FileRecord>> SelectFilesOf(SqlSession& sql, std::string_view id,
                                                      FileRole role);
absl::StatusOr<std::optional<FileRecord>> SelectFile(SqlSession& sql, std::string_view id,
                                                     FileRole role, std::string_view name);
// `photos`: how many of them the job has.
absl::StatusOr<FileTally> SelectTally(SqlSession& sql, std::string_view id, int64_t photos,
                                      std::string_view sha256);
absl::StatusOr<std::optional<JobFile>> SelectSameFile(SqlSession& sql, std::string_view id,
                                                      FileRole role, std::string_view sha256);

// Inserts the file, or replaces the job's one of the same role and name.
absl::Status UpsertFile(SqlSession& sql, std::string_view id, const FileRecord& file);
absl::Status DeleteFile(SqlSession& sql, std::string_view id, FileRole role, std::string_view name);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQL_FILES_H_
