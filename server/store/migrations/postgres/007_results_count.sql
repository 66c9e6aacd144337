-- What a job's runs left counts as its owner's, too.
ALTER TABLE jobs ADD COLUMN kept_bytes BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN preview_bytes BIGINT NOT NULL DEFAULT 0;
UPDATE jobs SET kept_bytes =
  (SELECT COALESCE(SUM((value->>'bytes')::BIGINT), 0) FROM jsonb_each(kept::JSONB))
  WHERE kept <> '';
