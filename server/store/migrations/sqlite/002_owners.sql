-- Jobs belong to clients. Those made before belong to none: only administrators see them.
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';
DROP INDEX jobs_by_request;
CREATE UNIQUE INDEX jobs_by_request ON jobs (owner, request_id) WHERE request_id <> '';
CREATE INDEX jobs_by_owner ON jobs (owner, create_time_ms, id);
