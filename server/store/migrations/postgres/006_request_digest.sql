-- What a request_id was used for; the options of the job may change later. Empty: not known.
ALTER TABLE jobs ADD COLUMN request_digest TEXT NOT NULL DEFAULT '';
