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
