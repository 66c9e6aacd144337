-- The queue is shared out among clients, and jobs need something of their workers.
ALTER TABLE jobs ADD COLUMN needs TEXT NOT NULL DEFAULT '';
DROP INDEX jobs_by_queue;
CREATE INDEX jobs_by_queue
  ON jobs (priority, needs, owner, queue_time_ms, create_time_ms, id, state) WHERE state = 2;
CREATE INDEX jobs_at_rest ON jobs (state) WHERE state NOT IN (2, 3);
CREATE INDEX jobs_by_lease ON jobs (lease_expires_ms) WHERE state = 3;
CREATE INDEX jobs_by_worker ON jobs (lease_owner) WHERE state = 3;
CREATE INDEX jobs_running ON jobs (owner) WHERE state = 3;
