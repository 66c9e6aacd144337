// Bringing a database to the newest layout. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQL_MIGRATIONS_H_
#define LITAGS_SERVER_STORE_SQL_MIGRATIONS_H_

#include <cstdint>
#include <limits>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/types/span.h"
#include "server/store/sql.h"

namespace litags {

inline constexpr int64_t kNewestVersion = std::numeric_limits<int64_t>::max();

// Leads to `version`: from nothing if it is the first of its list, else from the one before.
struct MigrationStep {
  int64_t version;
  const char* sql;
};

// How a kind of database keeps the number of its layout.
struct VersionAccess {
  absl::FunctionRef<absl::StatusOr<int64_t>(SqlSession&)> get;  // 0: nothing is there yet
  absl::FunctionRef<absl::Status(SqlSession&, int64_t version)> set;
};

// FAILED_PRECONDITION (STORE_TOO_NEW, STORE_TOO_OLD) if a database of version `found` is newer than
// this program or older than the first of `steps`.
absl::Status CheckVersion(int64_t found, absl::Span<const MigrationStep> steps);

// One step of a migration, in the session's transaction, which keeps others from migrating. False:
// the database has the newest version, or version `last`. Errors of CheckVersion().
absl::StatusOr<bool> MigrateOneStep(SqlSession& sql, absl::Span<const MigrationStep> steps,
                                    const VersionAccess& version, int64_t last);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQL_MIGRATIONS_H_
