-- The number of reports that a session had when an event last said that its next one is missing. No seal covers these rows.
CREATE TABLE reminders (
    session      TEXT NOT NULL REFERENCES sessions (session) ON DELETE CASCADE,
    event        TEXT NOT NULL,
    observations INTEGER NOT NULL,
    PRIMARY KEY (session, event)
) STRICT;
