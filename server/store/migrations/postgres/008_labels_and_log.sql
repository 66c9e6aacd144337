-- Labels of clients, calls that may be repeated, and each job's own log.
ALTER TABLE jobs ADD COLUMN labels TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN start_request_id TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN last_log_entry BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN log_bytes BIGINT NOT NULL DEFAULT 0;

CREATE TABLE log_entries (
  job_id TEXT COLLATE "C" NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  number BIGINT NOT NULL,
  time_ms BIGINT NOT NULL,
  severity BIGINT NOT NULL,
  text TEXT NOT NULL,
  PRIMARY KEY (job_id, number)
);
