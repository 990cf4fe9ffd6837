//! A folder's database as one file, and back.
//!
//! The copy is made by `VACUUM INTO`: one read transaction, so it holds exactly what was committed when it began, and the
//! writer goes on meanwhile. SQLite's other way, the backup API, starts anew whenever another process writes, which under
//! load may be never, and copies pages without reading them; this reads every row, and a damaged page ends it. Its cost is
//! that the write-ahead log grows until the copy is done.
//!
//! Either way a name appears only once what it names is whole, verified and on the disk.

use std::fs::{File, OpenOptions, Permissions};
use std::io::{Error, ErrorKind};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use sqlx::Connection;

use super::check::Inspection;
use super::error::{Failure, StoreError, unusable};
use super::sqlite::held::unstamp;
use super::sqlite::opening::{DATABASE, connect, inspect, lock, migrate, opening, version};

/// How a copy with damaged things in it is treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// There is none.
    Refused,
    /// It is kept, with them as they are; each is told.
    Skipped,
}

impl Damage {
    /// The outcome of a check, where it found damage.
    fn accept(self, checked: Result<(), StoreError>) -> Result<(), StoreError> {
        match checked {
            Err(StoreError::Damaged { .. }) if self == Damage::Skipped => Ok(()),
            checked => checked,
        }
    }
}

/// Copies the database of `dir` into the new file `out`, readable by its owner alone, and verifies the copy, telling what
/// was verified. A process may hold the folder and write.
///
/// # Errors
/// `out` exists, another backup writes `out.partial`, the file or, unless that is skipped, a thing in it is damaged, or the disk fails; nothing is
/// left at `out`.
pub async fn backup(dir: &Path, out: &Path, damage: Damage, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
    refuse_existing(out)?;
    let partial = beside(out, ".partial");
    let held = begin(&partial)?;
    let copied = async {
        // Another backup may have ended since.
        refuse_existing(out)?;
        copy(dir, &partial).await?;
        unstamp(&partial)?;
        damage.accept(Inspection::of_backup(&partial).await?.run(tell).await)?;
        publish(&partial, out)
    };
    let copied = copied.await;
    if copied.is_err() {
        // What failed is what the caller must hear.
        let _ = std::fs::remove_file(&partial);
    }
    drop(held);
    copied
}

/// An empty file of a backup under way, held by a lock, so that what a killed backup left is told from one that runs.
///
/// # Errors
/// Another backup is writing it.
fn begin(partial: &Path) -> Result<File, StoreError> {
    let begin = || {
        let file = OpenOptions::new().write(true).create(true).truncate(false).mode(0o600).open(partial)?;
        file.try_lock()?;
        if file.metadata()?.ino() != std::fs::metadata(partial)?.ino() {
            return Err(Error::new(ErrorKind::ResourceBusy, "another backup of this name has just ended"));
        }
        file.set_permissions(Permissions::from_mode(0o600))?;
        file.set_len(0)?;
        Ok(file)
    };
    let file = begin().map_err(|error| unusable(partial, error))?;
    ["-wal", "-shm", "-journal"].iter().try_for_each(|end| remove(&beside(partial, end)))?;
    Ok(file)
}

/// Makes `dir` a folder with the database of the backup `from`, its schema brought up to date, and verifies it, telling
/// what was verified.
///
/// # Errors
/// `dir` holds a database or is held by a process, the backup is damaged, unless that is skipped, or of a later release, or the disk fails; `dir`
/// then has no database.
pub async fn restore(from: &Path, dir: &Path, damage: Damage, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
    let held = lock(dir)?;
    let (database, partial) = (dir.join(DATABASE), dir.join(DATABASE).with_extension("partial"));
    for taken in [database.clone(), beside(&database, "-wal"), beside(&database, "-journal")] {
        refuse_existing(&taken)?;
    }
    // What a restore that was cut off left; the lock says that nobody is at it.
    let leftovers = ["", "-wal", "-shm", "-journal"].map(|end| beside(&partial, end));
    leftovers.iter().try_for_each(|file| remove(file))?;
    let restored = async {
        std::fs::copy(from, &partial).map_err(|error| unusable(from, error))?;
        let mut connection = connect(&partial).await?;
        if version(&mut connection).await? == 0 {
            return Err(unusable(from, Error::new(ErrorKind::InvalidData, "it is no backup of a store")));
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

/// Gives what is verified its name, durably.
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
