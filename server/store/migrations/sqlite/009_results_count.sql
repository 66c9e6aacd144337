-- What a job's runs left counts as its owner's, too.
ALTER TABLE jobs ADD COLUMN kept_bytes INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN preview_bytes INTEGER NOT NULL DEFAULT 0;
UPDATE jobs SET kept_bytes =
  (SELECT COALESCE(SUM(json_extract(value, '$.bytes')), 0) FROM json_each(kept)) WHERE kept <> '';
