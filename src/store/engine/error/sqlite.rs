//! The classification of SQLite errors.

use super::Cause;

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

pub(super) fn cause(error: &sqlx::Error) -> Cause {
    match error {
        sqlx::Error::Database(database) => {
            of_code(database.code().and_then(|code| code.parse().ok()).unwrap_or_default())
        }
        sqlx::Error::Io(cause) if cause.kind() == std::io::ErrorKind::StorageFull => Cause::Full,
        sqlx::Error::Io(_) => Cause::Fatal,
        sqlx::Error::PoolTimedOut | sqlx::Error::PoolClosed | sqlx::Error::WorkerCrashed => Cause::Unavailable,
        sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) => Cause::DamagedRow,
        _ => Cause::Refused,
    }
}

/// Classifies an extended result code; its low byte is the primary code.
fn of_code(code: i32) -> Cause {
    match (code, code & 0xff) {
        (_, FULL) | (IO_ERROR_INDEX_SIZE, _) => Cause::Full,
        (_, IO_ERROR | CORRUPT | NOT_A_DATABASE | READ_ONLY) => Cause::Fatal,
        (_, BUSY | LOCKED | NO_MEMORY | INTERRUPTED | CANNOT_OPEN) => Cause::Unavailable,
        _ => Cause::Refused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_fsync_is_fatal_and_a_full_disk_is_not() {
        const IO_ERROR_FSYNC: i32 = 1034;
        assert_eq!([IO_ERROR_FSYNC, CORRUPT].map(of_code), [Cause::Fatal; 2]);
        assert_eq!([FULL, 4874].map(of_code), [Cause::Full; 2]);
    }

    /// A row that cannot be decoded as written is damage to that row alone.
    #[test]
    fn what_cannot_be_read_is_a_damaged_row() {
        let column = sqlx::Error::ColumnDecode { index: "seal".into(), source: "not text".into() };
        let value = sqlx::Error::Decode("not a number".into());
        assert_eq!([column, value].map(|error| cause(&error)), [Cause::DamagedRow; 2]);
    }

    #[test]
    fn a_broken_constraint_is_refused() {
        const CONSTRAINT_UNIQUE: i32 = 2067;
        assert_eq!(of_code(CONSTRAINT_UNIQUE), Cause::Refused);
    }
}
