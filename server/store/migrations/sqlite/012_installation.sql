-- Which installation this is: one row, made at the first start.
CREATE TABLE installation (
  number INTEGER PRIMARY KEY CHECK (number = 1),
  id TEXT NOT NULL
) WITHOUT ROWID;
