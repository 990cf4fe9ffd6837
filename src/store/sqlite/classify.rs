//! What an error of SQLite means.

use std::sync::Arc;

use crate::store::error::StoreError;

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

pub(in crate::store) fn classify(doing: &'static str, error: sqlx::Error) -> StoreError {
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
