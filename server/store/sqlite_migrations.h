#ifndef LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_
#define LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_

#include "absl/status/status.h"
#include "server/store/sqlite.h"

namespace litags {

// Brings a database of any earlier version to the newest one, in one transaction per step.
// FAILED_PRECONDITION (STORE_TOO_NEW) if it is newer than this program.
absl::Status MigrateSqlite(SqliteConnection* connection);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQLITE_MIGRATIONS_H_
