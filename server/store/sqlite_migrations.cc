#include "server/store/sqlite_migrations.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/sql_migrations.h"

namespace litags {
namespace {

// Step n leads from version n to n + 1 (PRAGMA user_version). Steps that were released are never
// edited; a change of the layout is a new step.
const char* const kSteps[] = {
    R"sql(
CREATE TABLE jobs (
  id TEXT PRIMARY KEY,
  request_id TEXT NOT NULL,
  display_name TEXT NOT NULL,
  state INTEGER NOT NULL,
  cancel_requested INTEGER NOT NULL,
  attempt INTEGER NOT NULL,
  lease_owner TEXT NOT NULL,
  lease_expires_ms INTEGER NOT NULL,
  create_time_ms INTEGER NOT NULL,
  start_time_ms INTEGER NOT NULL,
  end_time_ms INTEGER NOT NULL,
  queue_time_ms INTEGER NOT NULL,
  last_event INTEGER NOT NULL,
  photos INTEGER NOT NULL,
  bytes INTEGER NOT NULL,
  snapshot_iteration INTEGER NOT NULL,
  scene_path TEXT NOT NULL,
  options TEXT NOT NULL,
  progress TEXT NOT NULL,
  error TEXT NOT NULL,
  report TEXT NOT NULL
) WITHOUT ROWID;
CREATE UNIQUE INDEX jobs_by_request ON jobs (request_id) WHERE request_id <> '';
CREATE INDEX jobs_by_time ON jobs (create_time_ms, id);
CREATE INDEX jobs_by_queue ON jobs (state, queue_time_ms);

CREATE TABLE files (
  job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  role INTEGER NOT NULL,
  name TEXT NOT NULL,
  size_bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL,
  width INTEGER NOT NULL,
  height INTEGER NOT NULL,
  PRIMARY KEY (job_id, role, name)
) WITHOUT ROWID;

CREATE TABLE events (
  job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  number INTEGER NOT NULL,
  time_ms INTEGER NOT NULL,
  kind INTEGER NOT NULL,
  payload TEXT NOT NULL,
  PRIMARY KEY (job_id, number)
) WITHOUT ROWID;
)sql",
    // Jobs belong to clients. Those made before belong to none: only administrators see them.
    R"sql(
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';
DROP INDEX jobs_by_request;
CREATE UNIQUE INDEX jobs_by_request ON jobs (owner, request_id) WHERE request_id <> '';
CREATE INDEX jobs_by_owner ON jobs (owner, create_time_ms, id);
)sql",
    R"sql(
ALTER TABLE jobs ADD COLUMN content_digest TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN lease_start_ms INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN run_ms INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN expire_time_ms INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN policy TEXT NOT NULL DEFAULT '';
DROP INDEX jobs_by_queue;
CREATE INDEX jobs_by_queue ON jobs (state, priority DESC, queue_time_ms);
CREATE INDEX jobs_by_expiry ON jobs (expire_time_ms) WHERE expire_time_ms > 0;
CREATE INDEX files_by_digest ON files (sha256);
)sql",
    // What the engine leaves is in the blob store, and named here; where it was a file before,
    // ImportWorkFolders() brings it there.
    R"sql(
ALTER TABLE jobs DROP COLUMN scene_path;
ALTER TABLE jobs ADD COLUMN kept TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN has_litter INTEGER NOT NULL DEFAULT 0;
CREATE INDEX jobs_by_litter ON jobs (id) WHERE has_litter = 1;
)sql",
    // The queue is shared out among clients, and jobs need something of their workers.
    R"sql(
ALTER TABLE jobs ADD COLUMN needs TEXT NOT NULL DEFAULT '';
DROP INDEX jobs_by_queue;
CREATE INDEX jobs_by_queue
  ON jobs (priority, needs, owner, queue_time_ms, create_time_ms, id, state) WHERE state = 2;
CREATE INDEX jobs_at_rest ON jobs (state) WHERE state NOT IN (2, 3);
CREATE INDEX jobs_by_lease ON jobs (lease_expires_ms) WHERE state = 3;
CREATE INDEX jobs_by_worker ON jobs (lease_owner) WHERE state = 3;
CREATE INDEX jobs_running ON jobs (owner) WHERE state = 3;
)sql",
    // Workers say that they are there.
    R"sql(
CREATE TABLE workers (
  name TEXT PRIMARY KEY,
  seen_ms INTEGER NOT NULL,
  resources TEXT NOT NULL
) WITHOUT ROWID;
)sql",
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
