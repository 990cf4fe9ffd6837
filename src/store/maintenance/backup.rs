//! Backup of a folder's database into one file, and restore from it.
//!
//! The copy is made by `VACUUM INTO`, which is one read transaction: the copy holds exactly what was committed when it
//! began, and the writer continues meanwhile. SQLite's other way, the backup API, restarts whenever another process
//! writes, so it may never finish under load. It also copies pages without reading them. `VACUUM INTO` reads every row
//! and fails on a damaged page. Its cost is that the write-ahead log grows until the copy is done.
//!
//! In both directions the final file name appears only after the file is complete, verified and synced to disk.

use std::fs::{File, OpenOptions, Permissions};
use std::io::{Error, ErrorKind};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use sqlx::Connection;

use crate::store::engine::error::{Failure, StoreError, unusable};
use crate::store::engine::sqlite::held_file::unstamp;
use crate::store::engine::sqlite::opening::{DATABASE, connect, inspect, lock, migrate, opening, version};
use crate::store::maintenance::check::Inspection;

/// How to treat a copy that contains damaged rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// Damage is an error.
    Refused,
    /// The copy is kept with its damaged rows as they are, and each is reported.
    Skipped,
}

impl Damage {
    /// Turns reported damage into success if damage is to be skipped.
    fn accept(self, checked: Result<(), StoreError>) -> Result<(), StoreError> {
        match checked {
            Err(StoreError::Damaged { .. }) if self == Damage::Skipped => Ok(()),
            checked => checked,
        }
    }
}

/// Copies the database of `dir` into the new file `out`, readable by its owner alone. Then verifies the copy and
/// reports through `tell` what was verified. A process may hold the folder and write meanwhile.
///
/// # Errors
/// Fails if `out` exists, another backup is writing `out.partial`, the file is damaged, or the disk fails. A damaged
/// row fails too, unless damage is skipped. Nothing is left at `out` after a failure.
pub async fn backup(dir: &Path, out: &Path, damage: Damage, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
    refuse_existing(out)?;
    let partial = beside(out, ".partial");
    let held = begin(&partial)?;
    let copied = async {
        // Another backup may have finished in the meantime.
        refuse_existing(out)?;
        copy(dir, &partial).await?;
        unstamp(&partial)?;
        damage.accept(Inspection::of_backup(&partial).await?.run(tell).await)?;
        publish(&partial, out)
    };
    let copied = copied.await;
    if copied.is_err() {
        // The first failure is the one to report.
        let _ = std::fs::remove_file(&partial);
    }
    drop(held);
    copied
}

/// Opens an empty file for a backup and locks it, so that a leftover of a killed backup differs from a running backup.
///
/// # Errors
/// Fails if another backup is writing it.
fn begin(partial: &Path) -> Result<File, StoreError> {
    let begin = || {
        let file = OpenOptions::new().write(true).create(true).truncate(false).mode(0o600).open(partial)?;
        file.try_lock()?;
        if file.metadata()?.ino() != std::fs::metadata(partial)?.ino() {
            return Err(Error::new(ErrorKind::ResourceBusy, "another backup with this name has just ended"));
        }
        file.set_permissions(Permissions::from_mode(0o600))?;
        file.set_len(0)?;
        Ok(file)
    };
    let file = begin().map_err(|error| unusable(partial, error))?;
    ["-wal", "-shm", "-journal"].iter().try_for_each(|end| remove(&beside(partial, end)))?;
    Ok(file)
}

/// Creates the database of `dir` from the backup `from` and brings its schema up to date. Then verifies it and reports
/// through `tell` what was verified.
///
/// # Errors
/// Fails if `dir` holds a database or a process holds `dir`, or if the disk fails. A backup that is damaged fails too,
/// unless damage is skipped, as does one of a later release. `dir` has no database after a failure.
pub async fn restore(from: &Path, dir: &Path, damage: Damage, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
    let held = lock(dir)?;
    let (database, partial) = (dir.join(DATABASE), dir.join(DATABASE).with_extension("partial"));
    for file in [database.clone(), beside(&database, "-wal"), beside(&database, "-journal")] {
        refuse_existing(&file)?;
    }
    // Files left by an interrupted restore; the lock guarantees that no restore is using them.
    let leftovers = ["", "-wal", "-shm", "-journal"].map(|end| beside(&partial, end));
    leftovers.iter().try_for_each(|file| remove(file))?;
    let restored = async {
        std::fs::copy(from, &partial).map_err(|error| unusable(from, error))?;
        let mut connection = connect(&partial).await?;
        if version(&mut connection).await? == 0 {
            return Err(unusable(from, Error::new(ErrorKind::InvalidData, "it is not a backup of a store")));
        }
        migrate(&mut connection).await?;
        connection.close().await.map_err(opening)?;
        damage.accept(Inspection::of_backup(&partial).await?.run(tell).await)?;
        publish(&partial, &database)
    };
    let restored = restored.await;
    if restored.is_err() {
        let _ = leftovers.iter().try_for_each(|file| remove(file));
    }
    drop(held);
    restored
}

async fn copy(dir: &Path, partial: &Path) -> Result<(), StoreError> {
    let name = partial.to_str().ok_or_else(|| unusable(partial, Error::other("its name is not UTF-8")))?;
    let mut connection = inspect(dir).await?;
    let copied = sqlx::query("VACUUM INTO ?").bind(name).execute(&mut connection).await;
    copied.map_err(|error| Failure::sqlite(error).during("copying the database"))?;
    connection.close().await.map_err(opening)
}

/// Gives a verified file its final name, durably.
fn publish(partial: &Path, name: &Path) -> Result<(), StoreError> {
    let folder = match name.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let publish = || {
        File::open(partial)?.sync_all()?;
        std::fs::rename(partial, name)?;
        File::open(folder)?.sync_all()
    };
    publish().map_err(|error| unusable(name, error))
}

fn refuse_existing(path: &Path) -> Result<(), StoreError> {
    match path.try_exists() {
        Ok(false) => Ok(()),
        Ok(true) => Err(unusable(path, Error::new(ErrorKind::AlreadyExists, "it exists already"))),
        Err(error) => Err(unusable(path, error)),
    }
}

fn remove(file: &Path) -> Result<(), StoreError> {
    match std::fs::remove_file(file) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(unusable(file, error)),
        _ => Ok(()),
    }
}

fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    name.into()
}
