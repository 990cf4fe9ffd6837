-- A seal is the SHA-256 of the row's fields, checked by every read.

-- What SQLite calls so, of paths as '$.field' alone.
CREATE FUNCTION json_extract(document TEXT, path TEXT) RETURNS TEXT LANGUAGE SQL IMMUTABLE
    RETURN CAST(document AS json) ->> substr(path, 3);
CREATE FUNCTION json_valid(document TEXT) RETURNS BOOLEAN LANGUAGE plpgsql IMMUTABLE STRICT AS $valid$
BEGIN
    PERFORM CAST(document AS json);
    RETURN TRUE;
EXCEPTION WHEN invalid_text_representation THEN
    RETURN FALSE;
END
$valid$;

CREATE TABLE jobs (
    sequence         BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    job              TEXT NOT NULL UNIQUE,
    tenant           TEXT NOT NULL,
    kind             TEXT NOT NULL,
    state            TEXT NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    steps_total      BIGINT NOT NULL,
    steps_done       BIGINT NOT NULL DEFAULT 0,
    cancel_requested BOOLEAN NOT NULL DEFAULT FALSE,
    attempt          BIGINT NOT NULL DEFAULT 0,
    -- Workers that died under it, since it was queued or last saved a checkpoint.
    deaths           BIGINT NOT NULL DEFAULT 0,
    worker           TEXT,
    lease_until_ms   BIGINT,
    -- No foreign key: a terminal job keeps the name of a policy deleted since.
    policy           TEXT,
    error            TEXT,
    created_ms       BIGINT NOT NULL,
    started_ms       BIGINT,
    finished_ms      BIGINT
);

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
);

CREATE TABLE job_reports (
    job  TEXT PRIMARY KEY REFERENCES jobs (job) ON DELETE CASCADE,
    json TEXT NOT NULL
);

-- The last turn of each tenant that ever queued a job: the lowest is the next.
CREATE TABLE turns (
    tenant TEXT PRIMARY KEY,
    turn   BIGINT NOT NULL
);

CREATE INDEX turns_in_order ON turns (turn, tenant);

-- What each tenant keeps, as its rows sum to.
CREATE TABLE usage (
    tenant   TEXT PRIMARY KEY,
    sessions BIGINT NOT NULL,
    bytes    BIGINT NOT NULL
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
    -- As its specification says; before its bytes, which a list passes over.
    periods_per_year DOUBLE PRECISION,
    json       BYTEA NOT NULL
);

-- A policy is named by its content, so two tenants may have the same one; each sees, dates and deletes its own.
CREATE TABLE policy_owners (
    sequence   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    tenant     TEXT NOT NULL,
    policy     TEXT NOT NULL REFERENCES policies (policy),
    created_ms BIGINT NOT NULL,
    UNIQUE (policy, tenant)
);

CREATE INDEX policy_owners_by_tenant ON policy_owners (tenant, sequence);

CREATE TABLE sessions (
    sequence        BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    session         TEXT NOT NULL UNIQUE,
    tenant          TEXT NOT NULL,
    policy          TEXT NOT NULL REFERENCES policies (policy) ON DELETE RESTRICT,
    initial_wealth  DOUBLE PRECISION,
    initial_holding DOUBLE PRECISION,
    -- Doubles, little-endian, eight bytes each.
    initial_history BYTEA NOT NULL,
    -- The SHA-256 of the history, so that a list need not read it.
    history_seal    BYTEA NOT NULL,
    horizon         BIGINT NOT NULL,
    -- What else was fixed when it was opened.
    plan_json       TEXT NOT NULL,
    -- Periods after which it is to be renewed by itself. It finds sessions, so no seal covers it.
    due             BIGINT,
    -- Entries that its tenant's total counts it with; it grows, so no seal covers it.
    room            BIGINT NOT NULL,
    -- Number of assets where there are several, by which an entry is counted; 0 of one.
    assets          BIGINT NOT NULL,
    created_ms      BIGINT NOT NULL,
    seal            BYTEA NOT NULL
);

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
);

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
);

-- The words by which sessions and policies are found: an index that no advice rests on, so no seal covers it.
CREATE TABLE words (
    tenant   TEXT NOT NULL,
    kind     TEXT NOT NULL,
    word     TEXT COLLATE "C" NOT NULL,
    -- Of the row of sessions or of policy_owners.
    sequence BIGINT NOT NULL,
    PRIMARY KEY (tenant, kind, word, sequence)
);

-- What happened in a session, in the order it was recorded.
CREATE TABLE entries (
    session      TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    entry        BIGINT NOT NULL,
    kind         TEXT NOT NULL CHECK (kind IN ('observation', 'correction', 'renewal')),
    -- From 1 among those of its kind: the period, or which correction it is.
    number       BIGINT NOT NULL,
    content_json TEXT NOT NULL,
    answer_json  TEXT NOT NULL,
    -- Doubles of several assets, little-endian, which either of them names by their place.
    numbers      BYTEA NOT NULL,
    created_ms   BIGINT NOT NULL,
    -- Of who reported it.
    access_key   TEXT NOT NULL,
    seal         BYTEA NOT NULL,
    PRIMARY KEY (session, entry)
);

-- The policies that sessions went on by, as their entries tell; they find sessions and keep policies.
CREATE TABLE renewals (
    session TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    -- From 1 among those of its session.
    number  BIGINT NOT NULL,
    policy  TEXT NOT NULL REFERENCES policies (policy) ON DELETE RESTRICT,
    -- The last period that the policy advises.
    horizon BIGINT NOT NULL,
    PRIMARY KEY (session, number)
);

CREATE INDEX renewals_by_policy ON renewals (policy);

-- Of a key the SHA-256 alone is kept. A revoked one stays: a store that ever had a key never again answers without one.
CREATE TABLE access_keys (
    sequence   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    access_key TEXT NOT NULL UNIQUE,
    hash       BYTEA NOT NULL UNIQUE,
    tenant     TEXT NOT NULL,
    roles      TEXT NOT NULL,
    created_ms BIGINT NOT NULL,
    revoked_ms BIGINT,
    expires_ms BIGINT,
    seal       BYTEA NOT NULL
);

-- Who did what. The entries of a key are a chain: each is sealed over the seal of the one before.
CREATE TABLE audit (
    sequence   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    tenant     TEXT NOT NULL,
    -- The key, or what stands for one.
    chain      TEXT NOT NULL,
    number     BIGINT NOT NULL,
    access_key TEXT NOT NULL,
    roles      TEXT NOT NULL,
    deed       TEXT NOT NULL,
    object     TEXT NOT NULL,
    outcome    TEXT NOT NULL,
    at_ms      BIGINT NOT NULL,
    previous   BYTEA NOT NULL,
    seal       BYTEA NOT NULL,
    UNIQUE (tenant, chain, number)
);
CREATE INDEX audit_by_tenant ON audit (tenant, sequence);
CREATE INDEX audit_by_object ON audit (object, sequence);

-- Where a chain ends, and where its oldest entries were cut off.
CREATE TABLE audit_chains (
    tenant     TEXT NOT NULL,
    chain      TEXT NOT NULL,
    -- From 1 over all chains, in the order they were begun.
    place      BIGINT NOT NULL UNIQUE,
    number     BIGINT NOT NULL,
    end_seal   BYTEA NOT NULL,
    cut_number BIGINT NOT NULL,
    cut_seal   BYTEA NOT NULL,
    seal       BYTEA NOT NULL,
    PRIMARY KEY (tenant, chain)
);

-- How many chains there are.
CREATE TABLE audit_total (
    row_id BIGINT PRIMARY KEY CHECK (row_id = 1),
    chains BIGINT NOT NULL,
    seal   BYTEA NOT NULL
);

-- The newest moment that a folder's process knew of.
CREATE TABLE heartbeat (
    row_id BIGINT PRIMARY KEY CHECK (row_id = 1),
    at_ms BIGINT NOT NULL
);
