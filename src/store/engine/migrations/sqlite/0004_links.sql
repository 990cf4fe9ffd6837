-- Links under which one client's letter is read without a key. Only the SHA-256 of a link's secret is kept.
CREATE TABLE links (
    link        TEXT PRIMARY KEY,
    session     TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    hash        BLOB NOT NULL UNIQUE,
    -- What the letter is dressed with.
    letter_json TEXT NOT NULL,
    created_ms  INTEGER NOT NULL,
    expires_ms  INTEGER NOT NULL,
    seal        BLOB NOT NULL
) STRICT;

CREATE INDEX links_by_session ON links (session, created_ms);
