#include "server/store/sqlite_migrations.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/sql_migrations.h"

namespace litags {
namespace {

// The files of migrations/sqlite; versions are kept in PRAGMA user_version.
constexpr MigrationStep kSteps[] = {
#include "server/store/sqlite_steps.inc"
};

absl::StatusOr<int64_t> Version(SqlSession& sql) {
  const auto statement = sql.Prepare("PRAGMA user_version");
  LITAGS_RETURN_IF_ERROR(statement->Step().status());
  return statement->Int(0);
}

absl::Status SetVersion(SqlSession& sql, int64_t version) {
  return sql.Execute(absl::StrCat("PRAGMA user_version=", version));
}

}  // namespace

absl::Status CheckSqliteVersion(SqliteConnection* connection) {
  LITAGS_ASSIGN_OR_RETURN(const int64_t version, Version(*connection));
  return CheckVersion(version, kSteps);
}

absl::Status MigrateSqlite(SqliteConnection* connection, int64_t last) {
  for (;;) {
    // Another process may migrate at the same time: each step looks under the write lock.
    LITAGS_ASSIGN_OR_RETURN(const auto transaction, SqliteTransaction::Begin(connection));
    LITAGS_ASSIGN_OR_RETURN(const bool stepped,
                            MigrateOneStep(*connection, kSteps, {Version, SetVersion}, last));
    if (!stepped) return absl::OkStatus();
    LITAGS_RETURN_IF_ERROR(transaction->Commit());
  }
}

}  // namespace litags
