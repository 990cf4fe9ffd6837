//! The files that a process holds: locked, and compared with the files that their names refer to.
//!
//! SQLite continues writing to a file that was moved or removed, and over one that was overwritten by a copy; what it
//! acknowledges then is lost. The writer therefore checks before it acknowledges a commit and each half second: the
//! name must refer to the held file, and the file must have the stamp of this process.
//!
//! The lock is `flock`'s, which on Linux is independent of the locks that SQLite takes. SQLite's locks, however, are
//! lost once any descriptor of the file is closed in the process. A held database is therefore closed after every
//! connection.

use std::cell::Cell;
use std::fs::{File, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use sqlx::SqliteConnection;

use crate::store::engine::error::{Failure, StoreError, unusable};

/// The offset of `PRAGMA user_version` in an SQLite file, a number that SQLite leaves to its user.
const STAMP_AT: u64 = 60;

/// A file that is locked and has not been replaced yet.
pub(in crate::store) struct HeldFile {
    path: PathBuf,
    file: File,
    stamp: Option<Stamp>,
}

struct Stamp {
    /// The stamp that the file has until the log with our stamp is copied into it.
    before: Cell<Option<u32>>,
    ours: u32,
}

impl HeldFile {
    /// Locks a file that only its owner can read, and creates it if it is absent.
    ///
    /// # Errors
    /// [`StoreError::Locked`] if another process holds it.
    pub(super) fn lock(path: PathBuf) -> Result<Self, StoreError> {
        let file = File::options().create(true).truncate(false).read(true).write(true).mode(0o600).open(&path);
        let file = file.map_err(|error| unusable(&path, error))?;
        match file.try_lock() {
            Ok(()) => Ok(HeldFile { path, file, stamp: None }),
            Err(TryLockError::WouldBlock) => Err(StoreError::Locked { path }),
            Err(TryLockError::Error(error)) => Err(unusable(&path, error)),
        }
    }

    /// Stamps the database in the file with a random number that identifies this process. A disk too full for that does
    /// not prevent the start.
    pub(super) async fn stamp(&mut self, connection: &mut SqliteConnection) -> Result<(), StoreError> {
        let ours = RandomState::new().hash_one(&self.path) as u32 | 1;
        let stamp = sqlx::AssertSqlSafe(format!("PRAGMA user_version = {}", ours.cast_signed()));
        let stamped = sqlx::query(stamp).execute(connection).await;
        match stamped.map_err(|error| Failure::sqlite(error).during("opening the store")) {
            Err(StoreError::Full { .. }) => {}
            stamped => {
                stamped?;
                self.stamp = Some(Stamp { before: Cell::new(self.stamped()), ours });
            }
        }
        Ok(())
    }

    /// Checks that the file was not replaced.
    ///
    /// # Errors
    /// [`StoreError::Replaced`] if the name refers to another file or to none, or if the file has other content.
    pub(super) fn verify(&self) -> Result<(), StoreError> {
        let is_same = match (self.path.metadata(), self.file.metadata()) {
            (Ok(named), Ok(held)) => (named.dev(), named.ino()) == (held.dev(), held.ino()),
            _ => false,
        };
        if is_same && self.is_stamped() { Ok(()) } else { Err(StoreError::Replaced { path: self.path.clone() }) }
    }

    fn is_stamped(&self) -> bool {
        let Some(Stamp { before, ours }) = &self.stamp else { return true };
        let found = self.stamped();
        if found == Some(*ours) {
            before.set(None);
            return true;
        }
        found.is_some() && found == before.get()
    }

    fn stamped(&self) -> Option<u32> {
        let mut bytes = [0; 4];
        self.file.read_exact_at(&mut bytes, STAMP_AT).ok()?;
        Some(u32::from_be_bytes(bytes))
    }
}

/// Removes the stamp from a database that no process has open, so that a copy does not carry the stamp of its source.
pub(in crate::store) fn unstamp(path: &Path) -> Result<(), StoreError> {
    let unstamp = || File::options().write(true).open(path)?.write_all_at(&[0; 4], STAMP_AT);
    unstamp().map_err(|error| unusable(path, error))
}
