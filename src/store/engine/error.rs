//! Errors of the store, classified by what the caller, the operator and the process must do next.

mod postgres;
mod sqlite;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

/// The reason why the store could not answer. Clones share the cause, because one failed commit answers a whole group.
#[derive(Debug, Clone, Error)]
pub enum StoreError {
    /// There is no disk space for the write; nothing of it was kept, and reads continue.
    #[error("the disk is full")]
    Full { source: Arc<sqlx::Error> },
    /// An I/O error, a failed fsync or a damaged file of SQLite: the state in memory can no longer be trusted. The
    /// process must exit.
    #[error("the store failed while {doing}; the process must restart")]
    Fatal { doing: &'static str, source: Arc<sqlx::Error> },
    /// The store is busy, closing, or not reached. The same request may succeed later.
    #[error("the store is unavailable while {doing}")]
    Unavailable { doing: &'static str, source: Option<Arc<sqlx::Error>> },
    /// The file has a schema newer than this binary's.
    #[error("the store has schema {found}, newer than {known}, the newest that this binary knows; use a newer binary")]
    NewerSchema { found: i64, known: i64 },
    /// The file has a schema older than this binary's; it is not brought up to date in a mode that may change nothing.
    #[error(
        "the store has schema {found}, older than {known}, which this binary needs; start the service once to \
         bring it up to date"
    )]
    OlderSchema { found: i64, known: i64 },
    /// A file that the process holds is no longer the one with its name, so its writes are lost. The process must exit.
    #[error("{} was moved, removed or replaced while the process used it; the process must restart", path.display())]
    Replaced { path: PathBuf },
    /// Another process holds the folder.
    #[error("{} is locked by another process", path.display())]
    Locked { path: PathBuf },
    /// SQLite before 3.51.3 can lose committed rows when it resets the write-ahead log.
    #[error("SQLite {found} is older than 3.51.3")]
    OldEngine { found: String },
    /// One stored thing is not what was written; everything else may be sound.
    #[error("{what} is damaged")]
    Corrupt { what: String },
    /// Things that a check found to be damaged.
    #[error("{first} is damaged{}", and_others(*others))]
    Damaged { first: String, others: usize },
    /// A repair was refused.
    #[error("nothing is repaired: {reason}")]
    NotRepaired { reason: String },
    /// A move was refused because rows of the folder are not in the target database.
    #[error("nothing was moved: {reason}")]
    NotMoved { reason: String },
    /// The folder or the lock file cannot be used.
    #[error("cannot use {}", path.display())]
    Folder { path: PathBuf, source: Arc<std::io::Error> },
    /// The database refused a statement: a defect of this program.
    #[error("the store refused a statement while {doing}")]
    Refused { doing: &'static str, source: Arc<sqlx::Error> },
    /// The write would exceed a quota of the tenant; nothing of it was kept.
    #[error(transparent)]
    OverQuota(OverQuota),
    /// The schema could not be brought up to date.
    #[error("cannot migrate the store")]
    Migration { source: Arc<sqlx::migrate::MigrateError> },
}

fn and_others(count: usize) -> String {
    match count {
        0 => String::new(),
        1 => ", and another thing is".to_owned(),
        count => format!(", and {count} other things are"),
    }
}

/// A limited resource of a tenant; the limits are set in [`Quotas`](crate::store::Quotas).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quota {
    QueuedJobs,
    Sessions,
    Bytes,
    /// The entries that the audit keeps of one key.
    AuditEntries,
}

/// An exceeded quota of a tenant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the tenant has {kept} {} and may have {limit}; this needs {wanted} more", quota.counted())]
pub struct OverQuota {
    pub quota: Quota,
    pub kept: u64,
    pub wanted: u64,
    pub limit: u64,
}

impl Quota {
    /// Returns the option of `ballast serve` that sets it.
    pub fn option(self) -> &'static str {
        match self {
            Quota::QueuedJobs => "quota-queued-jobs",
            Quota::Sessions => "quota-sessions",
            Quota::Bytes => "quota-bytes",
            Quota::AuditEntries => "audit-entries",
        }
    }

    fn counted(self) -> &'static str {
        match self {
            Quota::QueuedJobs => "queued jobs",
            Quota::Sessions => "sessions",
            Quota::Bytes => "bytes",
            Quota::AuditEntries => "entries of this key in the audit",
        }
    }
}

impl StoreError {
    /// Returns true if SQLite may have rolled the whole transaction back, so that nothing of its group can be kept.
    pub(super) fn ends_group(&self) -> bool {
        matches!(self, StoreError::Full { .. } | StoreError::Unavailable { .. }) || self.is_fatal()
    }

    pub fn is_fatal(&self) -> bool {
        matches!(self, StoreError::Fatal { .. } | StoreError::Replaced { .. })
    }
}

/// Returns the error for a file or folder that the operating system does not let this process use.
pub(in crate::store) fn unusable(path: &Path, error: std::io::Error) -> StoreError {
    StoreError::Folder { path: PathBuf::from(path), source: Arc::new(error) }
}

/// The meaning of an engine's error for a caller, independent of the engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::store) enum Cause {
    Full,
    Fatal,
    Unavailable,
    DamagedRow,
    Refused,
}

/// A failure inside an operation, before the name of the operation is added.
#[derive(Debug)]
pub(in crate::store) enum Failure {
    /// The error is classified at its source, so that the layers above need not know the engine.
    Engine(Cause, sqlx::Error),
    Corrupt(String),
    OverQuota(OverQuota),
}

impl Failure {
    pub(in crate::store) fn sqlite(error: sqlx::Error) -> Self {
        Failure::Engine(sqlite::cause(&error), error)
    }

    pub(in crate::store) fn postgres(error: sqlx::Error) -> Self {
        Failure::Engine(postgres::cause(&error), error)
    }

    /// Returns the description of damage to one stored thing.
    ///
    /// # Errors
    /// Returns the failure itself if it is anything else.
    pub(in crate::store) fn damage(self) -> Result<String, Failure> {
        match self {
            Failure::Corrupt(what) => Ok(what),
            Failure::Engine(Cause::DamagedRow, error) => Ok(format!("a row ({error})")),
            other => Err(other),
        }
    }

    pub(in crate::store) fn during(self, doing: &'static str) -> StoreError {
        let (cause, source) = match self {
            Failure::Corrupt(what) => return StoreError::Corrupt { what },
            Failure::OverQuota(over) => return StoreError::OverQuota(over),
            Failure::Engine(cause, error) => (cause, Arc::new(error)),
        };
        match cause {
            Cause::Full => StoreError::Full { source },
            Cause::Fatal => StoreError::Fatal { doing, source },
            Cause::Unavailable => StoreError::Unavailable { doing, source: Some(source) },
            Cause::DamagedRow => StoreError::Corrupt { what: format!("a row read while {doing}: {source}") },
            Cause::Refused => StoreError::Refused { doing, source },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_statement_spares_the_rest_of_its_group_and_a_full_disk_does_not() {
        let met = |cause| Failure::Engine(cause, sqlx::Error::RowNotFound).during("testing");
        assert!(!met(Cause::Refused).ends_group() && !met(Cause::DamagedRow).ends_group());
        for ending in [Cause::Full, Cause::Fatal, Cause::Unavailable] {
            assert!(met(ending).ends_group(), "{ending:?}");
        }
        assert!(met(Cause::Fatal).is_fatal());
    }
}
