-- Replaced files stay until their job has all of its files, and count as the client's till then.
ALTER TABLE jobs ADD COLUMN litter_bytes INTEGER NOT NULL DEFAULT 0;
