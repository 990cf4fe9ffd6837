-- Real numbers are in ANY columns: a REAL column would store -0.0 as 0.0.
-- A seal is the SHA-256 of the row's fields, checked by every read.

CREATE TABLE jobs (
    sequence         INTEGER PRIMARY KEY AUTOINCREMENT,
    job              TEXT NOT NULL UNIQUE,
    kind             TEXT NOT NULL,
    state            TEXT NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    request_json     TEXT NOT NULL,
    steps_total      INTEGER NOT NULL,
    steps_done       INTEGER NOT NULL DEFAULT 0,
    cancel_requested INTEGER NOT NULL DEFAULT 0,
    attempt          INTEGER NOT NULL DEFAULT 0,
    worker           TEXT,
    lease_until_ms   INTEGER,
    -- No foreign key: a terminal job keeps the name of a policy deleted since.
    policy           TEXT,
    report_json      TEXT,
    error            TEXT,
    created_ms       INTEGER NOT NULL,
    started_ms       INTEGER,
    finished_ms      INTEGER
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, sequence);

CREATE TABLE idempotency_keys (
    idempotency_key TEXT PRIMARY KEY,
    request_hash    TEXT NOT NULL,
    job             TEXT NOT NULL REFERENCES jobs (job)
) STRICT, WITHOUT ROWID;

CREATE TABLE checkpoints (
    job   TEXT NOT NULL REFERENCES jobs (job) ON DELETE CASCADE,
    step  INTEGER NOT NULL,
    bytes BLOB NOT NULL,
    seal  BLOB NOT NULL,
    PRIMARY KEY (job, step)
) STRICT;

CREATE TABLE policies (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    policy     TEXT NOT NULL UNIQUE,
    created_ms INTEGER NOT NULL,
    json       BLOB NOT NULL
) STRICT;

CREATE TABLE sessions (
    sequence        INTEGER PRIMARY KEY AUTOINCREMENT,
    session         TEXT NOT NULL UNIQUE,
    policy          TEXT NOT NULL REFERENCES policies (policy) ON DELETE RESTRICT,
    initial_wealth  ANY NOT NULL,
    -- Doubles, little-endian, eight bytes each.
    initial_history BLOB NOT NULL,
    horizon         INTEGER NOT NULL,
    created_ms      INTEGER NOT NULL,
    seal            BLOB NOT NULL
) STRICT;

CREATE INDEX sessions_by_policy ON sessions (policy);

CREATE TABLE observations (
    session             TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    period              INTEGER NOT NULL,
    content_hash        TEXT NOT NULL,
    log_return          ANY NOT NULL,
    executed_allocation ANY NOT NULL,
    advised_allocation  ANY NOT NULL,
    wealth_after        ANY NOT NULL,
    answer_json         TEXT NOT NULL,
    created_ms          INTEGER NOT NULL,
    seal                BLOB NOT NULL,
    PRIMARY KEY (session, period)
) STRICT;
