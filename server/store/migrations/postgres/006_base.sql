-- The layout that a new store starts from.
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
  options TEXT NOT NULL,
  policy TEXT NOT NULL,
  progress TEXT NOT NULL,
  error TEXT NOT NULL,
  report TEXT NOT NULL,
  kept TEXT NOT NULL DEFAULT '',
  has_litter BIGINT NOT NULL DEFAULT 0,
  needs TEXT COLLATE "C" NOT NULL DEFAULT '',
  litter_bytes BIGINT NOT NULL DEFAULT 0,
  request_digest TEXT NOT NULL DEFAULT ''
) WITH (fillfactor = 70);
CREATE UNIQUE INDEX jobs_by_request ON jobs (owner, request_id) WHERE request_id <> '';
CREATE INDEX jobs_by_time ON jobs (create_time_ms, id);
CREATE INDEX jobs_by_owner ON jobs (owner, create_time_ms, id);
CREATE INDEX jobs_by_queue ON jobs (priority, needs, owner, queue_time_ms, create_time_ms, id)
  WHERE state = 2;
CREATE INDEX jobs_by_lease ON jobs (lease_expires_ms) WHERE state = 3;
CREATE INDEX jobs_by_worker ON jobs (lease_owner) WHERE state = 3;
CREATE INDEX jobs_running ON jobs (owner) WHERE state = 3;
CREATE INDEX jobs_at_rest ON jobs (state) WHERE state NOT IN (2, 3);
CREATE INDEX jobs_by_expiry ON jobs (expire_time_ms) WHERE expire_time_ms > 0;
CREATE INDEX jobs_by_litter ON jobs (id) WHERE has_litter = 1;

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

CREATE TABLE workers (
  name TEXT COLLATE "C" PRIMARY KEY,
  seen_ms BIGINT NOT NULL,
  resources TEXT NOT NULL
);
