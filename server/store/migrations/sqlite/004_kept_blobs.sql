-- What the engine leaves is in the blob store, and named here; where it was a file before,
-- ImportWorkFolders() brings it there.
ALTER TABLE jobs DROP COLUMN scene_path;
ALTER TABLE jobs ADD COLUMN kept TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN has_litter INTEGER NOT NULL DEFAULT 0;
CREATE INDEX jobs_by_litter ON jobs (id) WHERE has_litter = 1;
