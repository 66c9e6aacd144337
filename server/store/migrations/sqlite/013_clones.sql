-- Of a clone: the job whose files it has yet to take.
ALTER TABLE jobs ADD COLUMN clone_source TEXT NOT NULL DEFAULT '';
