//! Whether a session is still what was read of it.

use super::codec::from_sql;
use super::entries::EntryRow;
use super::head::Head;
use super::query::query;
use super::{Engine, SessionRow, Store, StoreError};

/// What tells later whether a session is still what was read of it.
#[derive(Debug, Clone)]
pub struct Seen {
    pub(super) head: Head,
    /// Of a folder: the number of the session's changes that all are in `head`.
    pub(super) change: Option<u64>,
}

impl Seen {
    /// Number of entries.
    pub fn entries(&self) -> usize {
        self.head.entries
    }

    /// The session as the caller knows it once `appended` is answered with [`Append::Appended`](super::Append).
    pub fn followed_by(&self, appended: &EntryRow) -> Seen {
        // Whoever else wrote meanwhile raised the number too, so that it is not this one.
        Seen { head: appended.head(), change: self.change.map(|change| change + 1) }
    }
}

impl Store {
    /// Whether a session is still as it was `seen`: known without a read where a folder's session was not written to.
    pub async fn is_as_seen(&self, session: &str, seen: &mut Seen) -> Result<bool, StoreError> {
        let change = self.change(session);
        if change.is_some() && change == seen.change {
            return Ok(true);
        }
        let is_as_seen = self.head(session).await?.as_ref() == Some(&seen.head);
        if is_as_seen {
            seen.change = change;
        }
        Ok(is_as_seen)
    }

    /// A session that is about to be stored, as it is until somebody writes to it.
    pub fn about_to_open(&self, row: &SessionRow) -> Seen {
        Seen { change: self.change(&row.session), ..row.as_opened() }
    }

    /// A number that is another after every write to `session`, where this process makes all of them.
    pub(super) fn change(&self, session: &str) -> Option<u64> {
        match &self.engine {
            Engine::Sqlite(folder) => Some(folder.change(session)),
            Engine::Postgres(_) => None,
        }
    }

    /// The head of a session: where it is the one of what was read, that is still the session.
    pub async fn head(&self, session: &str) -> Result<Option<Head>, StoreError> {
        let last = query(
            "SELECT sessions.seal AS start_seal, entries.entry, entries.seal
             FROM sessions LEFT JOIN entries ON entries.session = sessions.session
             WHERE sessions.session = $1 ORDER BY entries.entry DESC LIMIT 1",
        );
        self.read("reading the head of a session", last.bind(session), |rows| {
            let Some(row) = rows.first() else { return Ok(None) };
            Ok(Some(match row.get::<Option<i64>>("entry")? {
                Some(entry) => Head { entries: from_sql(entry)?, seal: row.get("seal")? },
                None => Head { entries: 0, seal: row.get("start_seal")? },
            }))
        })
        .await
    }
}
