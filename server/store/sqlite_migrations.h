#ifndef LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_
#define LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_

#include <cstdint>

#include "absl/status/status.h"
#include "server/store/sql_migrations.h"
#include "server/store/sqlite.h"

namespace litags {

// Brings a database, which may be empty, to the newest version, in one transaction per step, or to
// version `last`, for tests. Errors of MigrateOneStep.
absl::Status MigrateSqlite(SqliteConnection* connection, int64_t last = kNewestVersion);

// Whether MigrateSqlite() would refuse the database; changes nothing.
absl::Status CheckSqliteVersion(SqliteConnection* connection);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_
