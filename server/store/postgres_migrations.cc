#include "server/store/postgres_migrations.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

// The files of migrations/postgres; versions are kept in the table litags_schema.
constexpr MigrationStep kSteps[] = {
#include "server/store/postgres_steps.inc"
};

absl::StatusOr<int64_t> Version(SqlSession& sql) {
  const auto table = sql.Prepare("SELECT COUNT(to_regclass('litags_schema'))");
  LITAGS_RETURN_IF_ERROR(table->Step().status());
  if (table->Int(0) == 0) return 0;
  const auto row = sql.Prepare("SELECT version FROM litags_schema");
  LITAGS_RETURN_IF_ERROR(row->Step().status());
  return row->Int(0);
}

absl::Status SetVersion(SqlSession& sql, int64_t version) {
  return sql.Execute(absl::StrCat("UPDATE litags_schema SET version = ", version));
}

absl::StatusOr<bool> StepInTransaction(PgConnection* connection, int64_t last) {
  // Any number will do that nobody else in the database uses: "litags" as letters of a phone.
  LITAGS_RETURN_IF_ERROR(connection->Execute(
      absl::StrCat("SET LOCAL lock_timeout = 0; SELECT pg_advisory_xact_lock(548247); "
                   "SET LOCAL lock_timeout = ",
                   kLockTimeoutMs)));
  LITAGS_ASSIGN_OR_RETURN(const bool stepped,
                          MigrateOneStep(*connection, kSteps, {Version, SetVersion}, last));
  if (stepped) LITAGS_RETURN_IF_ERROR(connection->Commit());
  return stepped;
}

}  // namespace

absl::Status CheckPostgresVersion(PgConnection* connection) {
  LITAGS_ASSIGN_OR_RETURN(const int64_t version, Version(*connection));
  return CheckVersion(version, kSteps);
}

absl::Status MigratePostgres(PgConnection* connection, int64_t last) {
  LITAGS_RETURN_IF_ERROR(connection->SetStatementTimeout(0));
  for (;;) {
    LITAGS_RETURN_IF_ERROR(connection->Begin());
    const auto stepped = StepInTransaction(connection, last);
    if (!stepped.ok() || !*stepped) connection->Rollback().IgnoreError();
    LITAGS_RETURN_IF_ERROR(stepped.status());
    if (!*stepped) break;
  }
  return connection->SetStatementTimeout(kStatementTimeoutMs);
}

}  // namespace litags
