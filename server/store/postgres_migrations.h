#ifndef LITAGS_SERVER_STORE_POSTGRES_MIGRATIONS_H_
#define LITAGS_SERVER_STORE_POSTGRES_MIGRATIONS_H_

#include <cstdint>

#include "absl/status/status.h"
#include "server/store/postgres.h"
#include "server/store/sql_migrations.h"

namespace litags {

// Brings a database, which may be empty, to the newest version, in one transaction per step under
// an advisory lock, or to version `last`, for tests. A step may take hours, and others wait for it;
// one that does not get a table's lock in kLockTimeoutMs is an error, lest it keep all others from
// the table. After an error the connection has no statement timeout. Errors of MigrateOneStep.
absl::Status MigratePostgres(PgConnection* connection, int64_t last = kNewestVersion);

// Whether MigratePostgres() would refuse the database; changes nothing.
absl::Status CheckPostgresVersion(PgConnection* connection);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_POSTGRES_MIGRATIONS_H_
