-- The layout that a new store starts from.
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
  options TEXT NOT NULL,
  progress TEXT NOT NULL,
  error TEXT NOT NULL,
  report TEXT NOT NULL,
  owner TEXT NOT NULL DEFAULT '',
  content_digest TEXT NOT NULL DEFAULT '',
  priority INTEGER NOT NULL DEFAULT 0,
  lease_start_ms INTEGER NOT NULL DEFAULT 0,
  run_ms INTEGER NOT NULL DEFAULT 0,
  expire_time_ms INTEGER NOT NULL DEFAULT 0,
  policy TEXT NOT NULL DEFAULT '',
  kept TEXT NOT NULL DEFAULT '',
  has_litter INTEGER NOT NULL DEFAULT 0,
  needs TEXT NOT NULL DEFAULT '',
  litter_bytes INTEGER NOT NULL DEFAULT 0,
  request_digest TEXT NOT NULL DEFAULT ''
) WITHOUT ROWID;
CREATE UNIQUE INDEX jobs_by_request ON jobs (owner, request_id) WHERE request_id <> '';
CREATE INDEX jobs_by_time ON jobs (create_time_ms, id);
CREATE INDEX jobs_by_owner ON jobs (owner, create_time_ms, id);
CREATE INDEX jobs_by_queue
  ON jobs (priority, needs, owner, queue_time_ms, create_time_ms, id, state) WHERE state = 2;
CREATE INDEX jobs_by_lease ON jobs (lease_expires_ms) WHERE state = 3;
CREATE INDEX jobs_by_worker ON jobs (lease_owner) WHERE state = 3;
CREATE INDEX jobs_running ON jobs (owner) WHERE state = 3;
CREATE INDEX jobs_at_rest ON jobs (state) WHERE state NOT IN (2, 3);
CREATE INDEX jobs_by_expiry ON jobs (expire_time_ms) WHERE expire_time_ms > 0;
CREATE INDEX jobs_by_litter ON jobs (id) WHERE has_litter = 1;

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
CREATE INDEX files_by_digest ON files (sha256);

CREATE TABLE events (
  job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  number INTEGER NOT NULL,
  time_ms INTEGER NOT NULL,
  kind INTEGER NOT NULL,
  payload TEXT NOT NULL,
  PRIMARY KEY (job_id, number)
) WITHOUT ROWID;

CREATE TABLE workers (
  name TEXT PRIMARY KEY,
  seen_ms INTEGER NOT NULL,
  resources TEXT NOT NULL
) WITHOUT ROWID;
