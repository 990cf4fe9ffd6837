-- Real numbers are in ANY columns: a REAL column would store -0.0 as 0.0.
-- A seal is the SHA-256 of the row's fields, checked by every read.

CREATE TABLE jobs (
    sequence         INTEGER PRIMARY KEY AUTOINCREMENT,
    job              TEXT NOT NULL UNIQUE,
    tenant           TEXT NOT NULL,
    kind             TEXT NOT NULL,
    state            TEXT NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    steps_total      INTEGER NOT NULL,
    steps_done       INTEGER NOT NULL DEFAULT 0,
    cancel_requested INTEGER NOT NULL DEFAULT 0,
    attempt          INTEGER NOT NULL DEFAULT 0,
    -- Workers that died under it, since it was queued or last saved a checkpoint.
    deaths           INTEGER NOT NULL DEFAULT 0,
    worker           TEXT,
    lease_until_ms   INTEGER,
    -- No foreign key: a terminal job keeps the name of a policy deleted since.
    policy           TEXT,
    error            TEXT,
    created_ms       INTEGER NOT NULL,
    started_ms       INTEGER,
    finished_ms      INTEGER
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, sequence);
CREATE INDEX jobs_by_tenant ON jobs (tenant, sequence);
CREATE INDEX jobs_in_turn ON jobs (tenant, state, sequence);
CREATE INDEX jobs_by_end ON jobs (finished_ms) WHERE finished_ms IS NOT NULL;

-- What may hold megabytes stands apart from the jobs: neither a list nor a renewed lease reads or rewrites it.
-- A request goes when its job ends.
CREATE TABLE job_requests (
    job         TEXT PRIMARY KEY REFERENCES jobs (job) ON DELETE CASCADE,
    json        TEXT NOT NULL,
    -- What the policy of a training is to be called.
    labels_json TEXT NOT NULL
) STRICT;

CREATE TABLE job_reports (
    job  TEXT PRIMARY KEY REFERENCES jobs (job) ON DELETE CASCADE,
    json TEXT NOT NULL
) STRICT;

-- The last turn of each tenant that ever queued a job: the lowest is the next.
CREATE TABLE turns (
    tenant TEXT PRIMARY KEY,
    turn   INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX turns_in_order ON turns (turn, tenant);

-- What each tenant keeps, as its rows sum to.
CREATE TABLE usage (
    tenant   TEXT PRIMARY KEY,
    sessions INTEGER NOT NULL,
    bytes    INTEGER NOT NULL
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
    -- As its specification says; before its bytes, which a list passes over.
    periods_per_year ANY,
    json       BLOB NOT NULL
) STRICT;

-- A policy is named by its content, so two tenants may have the same one; each sees, dates and deletes its own.
CREATE TABLE policy_owners (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant     TEXT NOT NULL,
    policy     TEXT NOT NULL REFERENCES policies (policy),
    created_ms INTEGER NOT NULL,
    UNIQUE (policy, tenant)
) STRICT;

CREATE INDEX policy_owners_by_tenant ON policy_owners (tenant, sequence);

CREATE TABLE sessions (
    sequence        INTEGER PRIMARY KEY AUTOINCREMENT,
    session         TEXT NOT NULL UNIQUE,
    tenant          TEXT NOT NULL,
    policy          TEXT NOT NULL REFERENCES policies (policy) ON DELETE RESTRICT,
    initial_wealth  ANY,
    initial_holding ANY,
    -- Doubles, little-endian, eight bytes each.
    -- The SHA-256 of the history, so that a list need not read it.
    history_seal    BLOB NOT NULL,
    initial_history BLOB NOT NULL,
    horizon         INTEGER NOT NULL,
    -- What else was fixed when it was opened.
    plan_json       TEXT NOT NULL,
    -- Periods after which it is to be renewed by itself. It finds sessions, so no seal covers it.
    due             INTEGER,
    -- Entries that its tenant's total counts it with; it grows, so no seal covers it.
    room            INTEGER NOT NULL,
    -- Number of assets where there are several, by which an entry is counted; 0 of one.
    assets          INTEGER NOT NULL,
    created_ms      INTEGER NOT NULL,
    seal            BLOB NOT NULL
) STRICT;

CREATE INDEX sessions_by_policy ON sessions (policy);
CREATE INDEX sessions_by_tenant ON sessions (tenant, sequence);
CREATE INDEX sessions_to_renew ON sessions (sequence) WHERE due IS NOT NULL;

-- A key lives as long as what it made.
CREATE TABLE idempotency_keys (
    tenant          TEXT NOT NULL,
    idempotency_key TEXT NOT NULL,
    request_hash    TEXT NOT NULL,
    job             TEXT REFERENCES jobs (job) ON DELETE CASCADE,
    session         TEXT REFERENCES sessions (session) ON DELETE CASCADE,
    PRIMARY KEY (tenant, idempotency_key),
    CHECK ((job IS NULL) <> (session IS NULL))
) STRICT, WITHOUT ROWID;

CREATE INDEX idempotency_keys_by_job ON idempotency_keys (job);
CREATE INDEX idempotency_keys_by_session ON idempotency_keys (session);

-- What a tenant calls its policies and sessions. They describe and find things, and no seal covers them.
CREATE TABLE labels (
    tenant TEXT NOT NULL,
    -- A policy or a session.
    object TEXT NOT NULL,
    name   TEXT NOT NULL,
    notes  TEXT NOT NULL,
    -- Each between line breaks.
    tags   TEXT NOT NULL,
    -- The name in lower case, to be put in order by.
    folded_name TEXT NOT NULL,
    -- Those of the name and the tags, a space before each.
    words TEXT NOT NULL,
    PRIMARY KEY (tenant, object)
) STRICT, WITHOUT ROWID;

-- The words by which sessions and policies are found: an index that no advice rests on, so no seal covers it.
CREATE TABLE words (
    tenant   TEXT NOT NULL,
    kind     TEXT NOT NULL,
    word     TEXT NOT NULL,
    -- Of the row of sessions or of policy_owners.
    sequence INTEGER NOT NULL,
    PRIMARY KEY (tenant, kind, word, sequence)
) STRICT, WITHOUT ROWID;

-- What happened in a session, in the order it was recorded.
CREATE TABLE entries (
    session      TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    entry        INTEGER NOT NULL,
    kind         TEXT NOT NULL CHECK (kind IN ('observation', 'correction', 'renewal')),
    -- From 1 among those of its kind: the period, or which correction it is.
    number       INTEGER NOT NULL,
    content_json TEXT NOT NULL,
    answer_json  TEXT NOT NULL,
    -- Doubles of several assets, little-endian, which either of them names by their place.
    numbers      BLOB NOT NULL,
    created_ms   INTEGER NOT NULL,
    -- Of who reported it.
    access_key   TEXT NOT NULL,
    seal         BLOB NOT NULL,
    PRIMARY KEY (session, entry)
) STRICT;

-- The policies that sessions went on by, as their entries tell; they find sessions and keep policies.
CREATE TABLE renewals (
    session TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    -- From 1 among those of its session.
    number  INTEGER NOT NULL,
    policy  TEXT NOT NULL REFERENCES policies (policy) ON DELETE RESTRICT,
    -- The last period that the policy advises.
    horizon INTEGER NOT NULL,
    PRIMARY KEY (session, number)
) STRICT, WITHOUT ROWID;

CREATE INDEX renewals_by_policy ON renewals (policy);

-- Of a key the SHA-256 alone is kept. A revoked one stays: a store that ever had a key never again answers without one.
CREATE TABLE access_keys (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    access_key TEXT NOT NULL UNIQUE,
    hash       BLOB NOT NULL UNIQUE,
    tenant     TEXT NOT NULL,
    roles      TEXT NOT NULL,
    created_ms INTEGER NOT NULL,
    revoked_ms INTEGER,
    expires_ms INTEGER,
    seal       BLOB NOT NULL
) STRICT;

-- Who did what. The entries of a key are a chain: each is sealed over the seal of the one before.
CREATE TABLE audit (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant     TEXT NOT NULL,
    -- The key, or what stands for one.
    chain      TEXT NOT NULL,
    number     INTEGER NOT NULL,
    access_key TEXT NOT NULL,
    roles      TEXT NOT NULL,
    deed       TEXT NOT NULL,
    object     TEXT NOT NULL,
    outcome    TEXT NOT NULL,
    at_ms      INTEGER NOT NULL,
    previous   BLOB NOT NULL,
    seal       BLOB NOT NULL,
    UNIQUE (tenant, chain, number)
) STRICT;
CREATE INDEX audit_by_tenant ON audit (tenant, sequence);
CREATE INDEX audit_by_object ON audit (object, sequence);

-- Where a chain ends, and where its oldest entries were cut off.
CREATE TABLE audit_chains (
    tenant     TEXT NOT NULL,
    chain      TEXT NOT NULL,
    -- From 1 over all chains, in the order they were begun.
    place      INTEGER NOT NULL UNIQUE,
    number     INTEGER NOT NULL,
    end_seal   BLOB NOT NULL,
    cut_number INTEGER NOT NULL,
    cut_seal   BLOB NOT NULL,
    seal       BLOB NOT NULL,
    PRIMARY KEY (tenant, chain)
) STRICT, WITHOUT ROWID;

-- How many chains there are.
CREATE TABLE audit_total (
    row_id INTEGER PRIMARY KEY CHECK (row_id = 1),
    chains INTEGER NOT NULL,
    seal   BLOB NOT NULL
) STRICT;

-- The newest moment that a folder's process knew of.
CREATE TABLE heartbeat (
    row_id INTEGER PRIMARY KEY CHECK (row_id = 1),
    at_ms INTEGER NOT NULL
) STRICT;
