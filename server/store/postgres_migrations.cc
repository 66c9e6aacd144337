#include "server/store/postgres_migrations.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

// Step n leads from version n to n + 1 (table litags_schema). Steps that were released are never
// edited; a change of the layout is a new step. Texts are ordered by their bytes, as in SQLite.
const char* const kSteps[] = {
    R"sql(
CREATE TABLE litags_schema (version BIGINT NOT NULL);
INSERT INTO litags_schema VALUES (0);

CREATE TABLE jobs (
  id TEXT COLLATE "C" PRIMARY KEY,
  owner TEXT COLLATE "C" NOT NULL,
  request_id TEXT COLLATE "C" NOT NULL,
  content_digest TEXT NOT NULL,
  create_time_ms BIGINT NOT NULL,
  display_name TEXT NOT NULL,
  state BIGINT NOT NULL,
  cancel_requested BIGINT NOT NULL,
  attempt BIGINT NOT NULL,
  priority BIGINT NOT NULL,
  lease_owner TEXT COLLATE "C" NOT NULL,
  lease_start_ms BIGINT NOT NULL,
  lease_expires_ms BIGINT NOT NULL,
  run_ms BIGINT NOT NULL,
  start_time_ms BIGINT NOT NULL,
  end_time_ms BIGINT NOT NULL,
  queue_time_ms BIGINT NOT NULL,
  expire_time_ms BIGINT NOT NULL,
  last_event BIGINT NOT NULL,
  photos BIGINT NOT NULL,
  bytes BIGINT NOT NULL,
  snapshot_iteration BIGINT NOT NULL,
  scene_path TEXT NOT NULL,
  options TEXT NOT NULL,
  policy TEXT NOT NULL,
  progress TEXT NOT NULL,
  error TEXT NOT NULL,
  report TEXT NOT NULL
) WITH (fillfactor = 70);
CREATE UNIQUE INDEX jobs_by_request ON jobs (owner, request_id) WHERE request_id <> '';
CREATE INDEX jobs_by_time ON jobs (create_time_ms, id);
CREATE INDEX jobs_by_owner ON jobs (owner, create_time_ms, id);
CREATE INDEX jobs_by_queue ON jobs (priority DESC, queue_time_ms, create_time_ms, id)
  WHERE state = 2;
CREATE INDEX jobs_by_lease ON jobs (lease_expires_ms) WHERE state = 3;
CREATE INDEX jobs_by_worker ON jobs (lease_owner) WHERE state = 3;
CREATE INDEX jobs_by_expiry ON jobs (expire_time_ms) WHERE expire_time_ms > 0;

CREATE TABLE files (
  job_id TEXT COLLATE "C" NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  role BIGINT NOT NULL,
  name TEXT COLLATE "C" NOT NULL,
  size_bytes BIGINT NOT NULL,
  sha256 TEXT COLLATE "C" NOT NULL,
  width BIGINT NOT NULL,
  height BIGINT NOT NULL,
  PRIMARY KEY (job_id, role, name)
);
CREATE INDEX files_by_digest ON files (sha256);

CREATE TABLE events (
  job_id TEXT COLLATE "C" NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  number BIGINT NOT NULL,
  time_ms BIGINT NOT NULL,
  kind BIGINT NOT NULL,
  payload TEXT NOT NULL,
  PRIMARY KEY (job_id, number)
);
)sql",
    // What the engine leaves is in the blob store, and named here; where it was a file before,
    // ImportWorkFolders() brings it there.
    R"sql(
ALTER TABLE jobs DROP COLUMN scene_path;
ALTER TABLE jobs ADD COLUMN kept TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN has_litter BIGINT NOT NULL DEFAULT 0;
CREATE INDEX jobs_by_litter ON jobs (id) WHERE has_litter = 1;
)sql",
    // The queue is shared out among clients, and jobs need something of their workers.
    R"sql(
ALTER TABLE jobs ADD COLUMN needs TEXT COLLATE "C" NOT NULL DEFAULT '';
DROP INDEX jobs_by_queue;
CREATE INDEX jobs_by_queue ON jobs (priority, needs, owner, queue_time_ms, create_time_ms, id)
  WHERE state = 2;
CREATE INDEX jobs_at_rest ON jobs (state) WHERE state NOT IN (2, 3);
CREATE INDEX jobs_running ON jobs (owner) WHERE state = 3;
)sql",
    // Workers say that they are there.
    R"sql(
CREATE TABLE workers (
  name TEXT COLLATE "C" PRIMARY KEY,
  seen_ms BIGINT NOT NULL,
  resources TEXT NOT NULL
);
)sql",
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
  LITAGS_RETURN_IF_ERROR(connection->Execute("SELECT pg_advisory_xact_lock(548247)"));
  LITAGS_ASSIGN_OR_RETURN(const bool stepped,
                          MigrateOneStep(*connection, kSteps, {Version, SetVersion}, last));
  if (stepped) LITAGS_RETURN_IF_ERROR(connection->Commit());
  return stepped;
}

}  // namespace

absl::Status MigratePostgres(PgConnection* connection, int64_t last) {
  for (;;) {
    LITAGS_RETURN_IF_ERROR(connection->Begin());
    const auto stepped = StepInTransaction(connection, last);
    if (!stepped.ok() || !*stepped) connection->Rollback().IgnoreError();
    LITAGS_RETURN_IF_ERROR(stepped.status());
    if (!*stepped) return absl::OkStatus();
  }
}

}  // namespace litags
