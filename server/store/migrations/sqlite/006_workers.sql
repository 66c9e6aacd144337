-- Workers say that they are there.
CREATE TABLE workers (
  name TEXT PRIMARY KEY,
  seen_ms INTEGER NOT NULL,
  resources TEXT NOT NULL
) WITHOUT ROWID;
