-- Labels of clients, calls that may be repeated, and each job's own log.
ALTER TABLE jobs ADD COLUMN labels TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN start_request_id TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN last_log_entry INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN log_bytes INTEGER NOT NULL DEFAULT 0;

CREATE TABLE log_entries (
  job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  number INTEGER NOT NULL,
  time_ms INTEGER NOT NULL,
  severity INTEGER NOT NULL,
  text TEXT NOT NULL,
  PRIMARY KEY (job_id, number)
) WITHOUT ROWID;
