-- Receivers of events. The secret itself is kept, because it signs every delivery. No seal covers these rows.
CREATE TABLE subscriptions (
    sequence          BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    subscription      TEXT NOT NULL UNIQUE,
    tenant            TEXT NOT NULL,
    url               TEXT NOT NULL,
    -- Each kind between line breaks.
    events            TEXT NOT NULL,
    -- Each session between line breaks; empty for all of the tenant.
    sessions          TEXT NOT NULL,
    -- Changes of the advice up to this are no event.
    least_change      DOUBLE PRECISION NOT NULL,
    secret            BYTEA NOT NULL,
    -- Empty if it was never rotated; signs besides the secret until its end.
    previous_secret   BYTEA NOT NULL,
    previous_until_ms BIGINT NOT NULL,
    -- The idempotency key of the last rotation.
    rotation_key      TEXT NOT NULL DEFAULT '',
    created_ms        BIGINT NOT NULL,
    -- A process sends one of its deliveries until then.
    lease_until_ms    BIGINT NOT NULL DEFAULT 0,
    last_attempt_ms   BIGINT NOT NULL DEFAULT 0,
    last_delivered_ms BIGINT,
    last_error        TEXT NOT NULL DEFAULT '',
    -- Attempts that failed since the last delivery.
    failures          BIGINT NOT NULL DEFAULT 0,
    delivered         BIGINT NOT NULL DEFAULT 0,
    -- Events and dead letters that found no room.
    dropped           BIGINT NOT NULL DEFAULT 0
);

CREATE INDEX subscriptions_by_tenant ON subscriptions (tenant, sequence);

-- Events that are to be delivered, and those given up.
CREATE TABLE deliveries (
    sequence     BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    delivery     TEXT NOT NULL UNIQUE,
    subscription TEXT NOT NULL REFERENCES subscriptions (subscription) ON DELETE CASCADE,
    event        TEXT NOT NULL,
    body         TEXT NOT NULL,
    created_ms   BIGINT NOT NULL,
    attempts     BIGINT NOT NULL DEFAULT 0,
    -- When it may be sent; NULL of a dead letter.
    next_ms      BIGINT,
    error        TEXT NOT NULL DEFAULT ''
);

CREATE INDEX deliveries_due ON deliveries (next_ms) WHERE next_ms IS NOT NULL;
CREATE INDEX deliveries_by_subscription ON deliveries (subscription, next_ms, sequence);
