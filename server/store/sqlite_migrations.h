#ifndef LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_
#define LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_

#include <cstdint>

#include "absl/status/status.h"
#include "server/store/sql_migrations.h"
#include "server/store/sqlite.h"

namespace litags {

// Brings a database of any earlier version to the newest one, in one transaction per step, or to
// version `last`, for tests. FAILED_PRECONDITION (STORE_TOO_NEW) if it is newer than this program.
absl::Status MigrateSqlite(SqliteConnection* connection, int64_t last = kNewestVersion);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_
