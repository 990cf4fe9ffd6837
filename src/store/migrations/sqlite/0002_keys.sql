-- Of a key the SHA-256 alone is kept. A revoked one stays: a store that ever had a key never again answers without one.
CREATE TABLE access_keys (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    access_key TEXT NOT NULL UNIQUE,
    hash       BLOB NOT NULL UNIQUE,
    tenant     TEXT NOT NULL,
    roles      TEXT NOT NULL,
    created_ms INTEGER NOT NULL,
    revoked_ms INTEGER
) STRICT;

-- What was there before belongs to the tenant of those who need no key.
ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
CREATE INDEX jobs_by_tenant ON jobs (tenant, sequence);

ALTER TABLE sessions ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
CREATE INDEX sessions_by_tenant ON sessions (tenant, sequence);

-- A policy is named by its content, so two tenants may have the same one; each sees, dates and deletes its own.
CREATE TABLE policy_owners (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant     TEXT NOT NULL,
    policy     TEXT NOT NULL REFERENCES policies (policy),
    created_ms INTEGER NOT NULL,
    UNIQUE (policy, tenant)
) STRICT;
CREATE INDEX policy_owners_by_tenant ON policy_owners (tenant, sequence);
INSERT INTO policy_owners (tenant, policy, created_ms)
    SELECT 'default', policy, created_ms FROM policies ORDER BY sequence;

CREATE TABLE tenants_idempotency_keys (
    tenant          TEXT NOT NULL,
    idempotency_key TEXT NOT NULL,
    request_hash    TEXT NOT NULL,
    job             TEXT NOT NULL REFERENCES jobs (job),
    PRIMARY KEY (tenant, idempotency_key)
) STRICT, WITHOUT ROWID;
INSERT INTO tenants_idempotency_keys
    SELECT 'default', idempotency_key, request_hash, job FROM idempotency_keys;
DROP TABLE idempotency_keys;
ALTER TABLE tenants_idempotency_keys RENAME TO idempotency_keys;
