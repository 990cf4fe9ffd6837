//! Errors of the store: what the caller, the operator and the process must do next.

use std::path::PathBuf;
use std::sync::Arc;

use thiserror::Error;

/// Why the store could not answer. Clones share the cause, since one failed commit answers a whole group.
#[derive(Debug, Clone, Error)]
pub enum StoreError {
    /// No room for the write; nothing of it was kept, and reads go on. HTTP 507.
    #[error("the disk is full")]
    Full { source: Arc<sqlx::Error> },
    /// An I/O error, a failed fsync or a damaged file: what is in memory can no longer be trusted. The process must exit.
    #[error("the store failed while {doing}; the process must restart")]
    Fatal { doing: &'static str, source: Arc<sqlx::Error> },
    /// Busy, or closing. The same request may succeed later. HTTP 503.
    #[error("the store is unavailable while {doing}")]
    Unavailable { doing: &'static str, source: Option<Arc<sqlx::Error>> },
    /// The file was written by a later release.
    #[error("the store has schema {found}, newer than {known}, the newest this binary knows")]
    NewerSchema { found: i64, known: i64 },
    /// Another process holds the folder.
    #[error("{} is locked by another process", path.display())]
    Locked { path: PathBuf },
    /// SQLite before 3.51.3 can lose committed rows when it resets the write-ahead log.
    #[error("SQLite {found} is older than 3.51.3")]
    OldEngine { found: String },
    /// One stored thing is not what was written; everything else may be sound.
    #[error("{what} is damaged")]
    Corrupt { what: String },
    /// The folder or the lock file cannot be used.
    #[error("cannot use {}", path.display())]
    Folder { path: PathBuf, source: Arc<std::io::Error> },
    /// The database refused a statement: a defect of this program.
    #[error("the store refused a statement while {doing}")]
    Refused { doing: &'static str, source: Arc<sqlx::Error> },
    /// The schema could not be brought up to date.
    #[error("cannot migrate the store")]
    Migration { source: Arc<sqlx::migrate::MigrateError> },
}

impl StoreError {
    /// True where SQLite may have rolled the whole transaction back, so that nothing of its group can be kept.
    pub(super) fn ends_group(&self) -> bool {
        matches!(self, StoreError::Full { .. } | StoreError::Fatal { .. } | StoreError::Unavailable { .. })
    }

    pub fn is_fatal(&self) -> bool {
        matches!(self, StoreError::Fatal { .. })
    }
}

/// What goes wrong inside an operation, before it is known what was being done.
#[derive(Debug)]
pub(super) enum Failure {
    Database(sqlx::Error),
    Corrupt(String),
}

impl From<sqlx::Error> for Failure {
    fn from(error: sqlx::Error) -> Self {
        Failure::Database(error)
    }
}

impl Failure {
    pub(super) fn during(self, doing: &'static str) -> StoreError {
        match self {
            Failure::Corrupt(what) => StoreError::Corrupt { what },
            Failure::Database(error) => classify(doing, error),
        }
    }
}

// Result codes of SQLite, https://www.sqlite.org/rescode.html.
const BUSY: i32 = 5;
const LOCKED: i32 = 6;
const NO_MEMORY: i32 = 7;
const READ_ONLY: i32 = 8;
const INTERRUPTED: i32 = 9;
const IO_ERROR: i32 = 10;
const CORRUPT: i32 = 11;
const FULL: i32 = 13;
const CANNOT_OPEN: i32 = 14;
const NOT_A_DATABASE: i32 = 26;
/// The shared index of the write-ahead log could not grow; nothing was written yet.
const IO_ERROR_INDEX_SIZE: i32 = IO_ERROR | 19 << 8;

fn classify(doing: &'static str, error: sqlx::Error) -> StoreError {
    match &error {
        sqlx::Error::Database(database) => {
            let code = database.code().and_then(|code| code.parse().ok()).unwrap_or_default();
            classify_code(code, doing, error)
        }
        sqlx::Error::Io(cause) if cause.kind() == std::io::ErrorKind::StorageFull => {
            StoreError::Full { source: Arc::new(error) }
        }
        sqlx::Error::Io(_) => StoreError::Fatal { doing, source: Arc::new(error) },
        sqlx::Error::PoolTimedOut | sqlx::Error::PoolClosed | sqlx::Error::WorkerCrashed => {
            StoreError::Unavailable { doing, source: Some(Arc::new(error)) }
        }
        sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) => {
            StoreError::Corrupt { what: format!("a row read while {doing}: {error}") }
        }
        _ => StoreError::Refused { doing, source: Arc::new(error) },
    }
}

/// `code` is an extended code; its low byte is the primary one.
fn classify_code(code: i32, doing: &'static str, error: sqlx::Error) -> StoreError {
    let source = Arc::new(error);
    match (code, code & 0xff) {
        (_, FULL) | (IO_ERROR_INDEX_SIZE, _) => StoreError::Full { source },
        (_, IO_ERROR | CORRUPT | NOT_A_DATABASE | READ_ONLY) => StoreError::Fatal { doing, source },
        (_, BUSY | LOCKED | NO_MEMORY | INTERRUPTED | CANNOT_OPEN) => {
            StoreError::Unavailable { doing, source: Some(source) }
        }
        _ => StoreError::Refused { doing, source },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_code(code: i32) -> StoreError {
        classify_code(code, "testing", sqlx::Error::RowNotFound)
    }

    #[test]
    fn a_failed_fsync_is_fatal_and_a_full_disk_is_not() {
        const IO_ERROR_FSYNC: i32 = 1034;
        assert!(of_code(IO_ERROR_FSYNC).is_fatal());
        assert!(of_code(CORRUPT).is_fatal());
        assert!(matches!(of_code(FULL), StoreError::Full { .. }));
        assert!(matches!(of_code(4874), StoreError::Full { .. }));
    }

    #[test]
    fn a_broken_constraint_spares_the_rest_of_the_group() {
        const CONSTRAINT_UNIQUE: i32 = 2067;
        assert!(!of_code(CONSTRAINT_UNIQUE).ends_group());
        assert!(of_code(FULL).ends_group());
    }
}
