-- A seal is the SHA-256 of the row's fields, checked by every read.

CREATE TABLE jobs (
    sequence         BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    job              TEXT NOT NULL UNIQUE,
    kind             TEXT NOT NULL,
    state            TEXT NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    request_json     TEXT NOT NULL,
    steps_total      BIGINT NOT NULL,
    steps_done       BIGINT NOT NULL DEFAULT 0,
    cancel_requested BOOLEAN NOT NULL DEFAULT FALSE,
    attempt          BIGINT NOT NULL DEFAULT 0,
    worker           TEXT,
    lease_until_ms   BIGINT,
    -- No foreign key: a terminal job keeps the name of a policy deleted since.
    policy           TEXT,
    report_json      TEXT,
    error            TEXT,
    created_ms       BIGINT NOT NULL,
    started_ms       BIGINT,
    finished_ms      BIGINT
);

CREATE INDEX jobs_by_state ON jobs (state, sequence);

CREATE TABLE idempotency_keys (
    idempotency_key TEXT PRIMARY KEY,
    request_hash    TEXT NOT NULL,
    job             TEXT NOT NULL REFERENCES jobs (job)
);

CREATE TABLE checkpoints (
    job   TEXT NOT NULL REFERENCES jobs (job) ON DELETE CASCADE,
    step  BIGINT NOT NULL,
    bytes BYTEA NOT NULL,
    seal  BYTEA NOT NULL,
    PRIMARY KEY (job, step)
);

CREATE TABLE policies (
    sequence   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    policy     TEXT NOT NULL UNIQUE,
    created_ms BIGINT NOT NULL,
    json       BYTEA NOT NULL
);

CREATE TABLE sessions (
    sequence        BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    session         TEXT NOT NULL UNIQUE,
    policy          TEXT NOT NULL REFERENCES policies (policy) ON DELETE RESTRICT,
    initial_wealth  DOUBLE PRECISION NOT NULL,
    -- Doubles, little-endian, eight bytes each.
    initial_history BYTEA NOT NULL,
    horizon         BIGINT NOT NULL,
    created_ms      BIGINT NOT NULL,
    seal            BYTEA NOT NULL
);

CREATE INDEX sessions_by_policy ON sessions (policy);

CREATE TABLE observations (
    session             TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    period              BIGINT NOT NULL,
    content_hash        TEXT NOT NULL,
    log_return          DOUBLE PRECISION NOT NULL,
    executed_allocation DOUBLE PRECISION NOT NULL,
    advised_allocation  DOUBLE PRECISION NOT NULL,
    wealth_after        DOUBLE PRECISION NOT NULL,
    answer_json         TEXT NOT NULL,
    created_ms          BIGINT NOT NULL,
    seal                BYTEA NOT NULL,
    PRIMARY KEY (session, period)
);
