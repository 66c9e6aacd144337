-- Workers say that they are there.
CREATE TABLE workers (
  name TEXT COLLATE "C" PRIMARY KEY,
  seen_ms BIGINT NOT NULL,
  resources TEXT NOT NULL
);
