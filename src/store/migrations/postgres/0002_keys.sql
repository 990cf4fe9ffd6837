-- Of a key the SHA-256 alone is kept. A revoked one stays: a store that ever had a key never again answers without one.
CREATE TABLE access_keys (
    sequence   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    access_key TEXT NOT NULL UNIQUE,
    hash       BYTEA NOT NULL UNIQUE,
    tenant     TEXT NOT NULL,
    roles      TEXT NOT NULL,
    created_ms BIGINT NOT NULL,
    revoked_ms BIGINT
);

-- What was there before belongs to the tenant of those who need no key.
ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
CREATE INDEX jobs_by_tenant ON jobs (tenant, sequence);

ALTER TABLE sessions ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
CREATE INDEX sessions_by_tenant ON sessions (tenant, sequence);

-- A policy is named by its content, so two tenants may have the same one; each sees, dates and deletes its own.
CREATE TABLE policy_owners (
    sequence   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    tenant     TEXT NOT NULL,
    policy     TEXT NOT NULL REFERENCES policies (policy),
    created_ms BIGINT NOT NULL,
    UNIQUE (policy, tenant)
);
CREATE INDEX policy_owners_by_tenant ON policy_owners (tenant, sequence);
INSERT INTO policy_owners (tenant, policy, created_ms)
    SELECT 'default', policy, created_ms FROM policies ORDER BY sequence;

ALTER TABLE idempotency_keys ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
ALTER TABLE idempotency_keys DROP CONSTRAINT idempotency_keys_pkey;
ALTER TABLE idempotency_keys ADD PRIMARY KEY (tenant, idempotency_key);
