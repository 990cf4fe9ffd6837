//! Detects if a session has changed since it was read.

use crate::store::engine::codec::from_sql;
use crate::store::engine::query::query;
use crate::store::sessions::entries::EntryRow;
use crate::store::sessions::head::Head;
use crate::store::{Engine, SessionRow, Store, StoreError};

/// The version of a session when it was read, to detect later changes.
#[derive(Debug, Clone)]
pub struct RowVersion {
    pub(in crate::store) head: Head,
    /// For a folder: the number of the session's last change that `head` includes.
    pub(in crate::store) change: Option<u64>,
}

impl RowVersion {
    /// Number of entries.
    pub fn entries(&self) -> usize {
        self.head.entries
    }

    /// Returns the version of the session once `appended` is answered with [`Append::Appended`](crate::store::Append).
    pub fn followed_by(&self, appended: &EntryRow) -> RowVersion {
        // Another write in the meantime also raises the number, so that the numbers then differ.
        RowVersion { head: appended.head(), change: self.change.map(|change| change + 1) }
    }
}

impl Store {
    /// Returns whether a session is unchanged since it was `seen`; needs no read if a folder's session was not written
    /// to.
    pub async fn is_as_seen(&self, session: &str, seen: &mut RowVersion) -> Result<bool, StoreError> {
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

    /// Returns the version of a session that is about to be stored, valid until the next write to it.
    pub fn about_to_open(&self, row: &SessionRow) -> RowVersion {
        RowVersion { change: self.change(&row.session), ..row.as_opened() }
    }

    /// Returns a number that changes with every write to `session`; `None` if other processes may write to it.
    pub(in crate::store) fn change(&self, session: &str) -> Option<u64> {
        match &self.engine {
            Engine::Sqlite(folder) => Some(folder.change(session)),
            Engine::Postgres(_) => None,
        }
    }

    /// Returns the head of a session; if it equals the head of an earlier read, the session is unchanged.
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
