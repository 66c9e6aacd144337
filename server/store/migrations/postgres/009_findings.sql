-- What the server found in a photo when it was uploaded.
ALTER TABLE files ADD COLUMN about TEXT NOT NULL DEFAULT '';
