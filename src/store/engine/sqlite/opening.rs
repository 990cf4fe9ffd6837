//! Opening a folder: the lock, the engine's version, the schema, the leases of dead workers, the connections.

use std::path::Path;
use std::time::Duration;

use sqlx::sqlite::{
    SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection, SqliteConnection};

use super::held_file::HeldFile;
use super::write_ahead_log;
use crate::store::engine::error::{Failure, StoreError, unusable};
use crate::store::engine::migrations;
use crate::store::engine::query::Purpose;
use crate::store::jobs::state::JobState;

pub(in crate::store) const DATABASE: &str = "ballast.sqlite";
pub(super) const LOG: &str = "ballast.sqlite-wal";
const LOCK: &str = "ballast.lock";
/// The first release without the reset bug of the write-ahead log.
const OLDEST_ENGINE: [u32; 3] = [3, 51, 3];
/// A reader waits this long for recovery after a crash, and a writer for a process that adds or revokes a key.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);
/// Bytes of a page: three observations of 30 assets fit one page, while each would take a page of 4 KB alone.
const PAGE: u32 = 8192;
/// The number of pages in the log at which they are copied into the database. Many observations change the same index
/// page, which is then copied once for all of them. SQLite's default of 1000 copies most of them twice.
const COPIED_AT: &str = "4000";
/// Memory for the page cache of a writing connection, in KiB: for the index pages that appending observations uses.
const CACHE: &str = "-16384";
/// A log longer than this, in bytes, is truncated to it once it is copied into the database.
const LOG_KEPT: &str = "67108864";
/// Each read connection is a thread; reads are short. Advice has most of them. Of the list connections, lists of
/// sessions take turns on two, and one serves data that is shown at once.
const ADVICE_READERS: u32 = 4;
const LIST_READERS: u32 = 3;
const PROBE_READERS: u32 = 1;

/// An opened folder, its schema up to date. `held` is empty if another process may hold the folder.
pub(super) struct Opened {
    pub held: Vec<HeldFile>,
    pub writer: SqliteConnection,
    pub readers: Readers,
}

/// The read connections, by purpose.
#[derive(Clone)]
pub(super) struct Readers {
    advice: SqlitePool,
    lists: SqlitePool,
    probes: SqlitePool,
}

pub(super) async fn open(dir: &Path) -> Result<Opened, StoreError> {
    let lock = lock(dir)?;
    refuse_damaged_log(dir)?;
    let file = dir.join(DATABASE);
    // The database is locked too, because a second process could recreate a lock file that was removed.
    let mut database = HeldFile::lock(file.clone())?;
    let mut writer = connect(&file).await?;
    refuse_old_engine(&mut writer).await?;
    migrate(&mut writer).await?;
    end_leases(&mut writer).await?;
    database.stamp(&mut writer).await?;
    empty_log(&mut writer).await?;
    Ok(Opened { held: vec![lock, database], writer, readers: Readers::of(&file) })
}

/// Opens a folder like [`open()`], without holding it and without disturbing the process that holds it. The lock is
/// needed only to bring the schema up to date and to check a log that no process writes, and is released afterwards.
pub(super) async fn open_beside(dir: &Path) -> Result<Opened, StoreError> {
    let file = dir.join(DATABASE);
    refuse_damaged_log_unless_held(dir)?;
    if !is_current(&file).await? {
        let lock = lock(dir)?;
        let mut connection = connect(&file).await?;
        refuse_old_engine(&mut connection).await?;
        migrate(&mut connection).await?;
        connection.close().await.map_err(opening)?;
        drop(lock);
    }
    let mut writer = connect(&file).await?;
    refuse_old_engine(&mut writer).await?;
    Ok(Opened { held: Vec::new(), writer, readers: Readers::of(&file) })
}

/// Opens the database of a folder read-only, even if a process holds it.
pub(in crate::store) async fn inspect(dir: &Path) -> Result<SqliteConnection, StoreError> {
    let file = dir.join(DATABASE);
    existing(&file)?;
    refuse_damaged_log_unless_held(dir)?;
    let options = SqliteConnectOptions::new().filename(file).read_only(true).busy_timeout(BUSY_TIMEOUT);
    options.disable_statement_logging().connect().await.map_err(opening)
}

/// Opens a database file that nothing writes to, without leaving any file beside it.
pub(in crate::store) async fn inspect_file(file: &Path) -> Result<SqliteConnection, StoreError> {
    existing(file)?;
    let options = SqliteConnectOptions::new().filename(file).read_only(true).immutable(true);
    options.disable_statement_logging().connect().await.map_err(opening)
}

pub(in crate::store) fn existing(file: &Path) -> Result<(), StoreError> {
    file.metadata().map(drop).map_err(|error| unusable(file, error))
}

/// Returns whether the file exists with the schema of this binary.
async fn is_current(file: &Path) -> Result<bool, StoreError> {
    if !file.exists() {
        return Ok(false);
    }
    let (mut connection, migrator) = (connect(file).await?, migrations::sqlite());
    let found = version(&mut connection).await?;
    migrations::refuse_newer(&migrator, found)?;
    connection.close().await.map_err(opening)?;
    Ok(found == migrations::newest(&migrator))
}

impl Readers {
    fn of(file: &Path) -> Readers {
        Readers {
            advice: readers(file, ADVICE_READERS),
            lists: readers(file, LIST_READERS),
            probes: readers(file, PROBE_READERS),
        }
    }

    pub(super) fn of_purpose(&self, purpose: Purpose) -> &SqlitePool {
        match purpose {
            Purpose::Advice => &self.advice,
            Purpose::Lists => &self.lists,
            Purpose::Probes => &self.probes,
        }
    }

    pub(super) async fn close(&self) {
        for readers in [&self.advice, &self.lists, &self.probes] {
            readers.close().await;
        }
    }
}

fn readers(file: &Path, connections: u32) -> SqlitePool {
    let options = SqliteConnectOptions::new().filename(file).read_only(true).busy_timeout(BUSY_TIMEOUT);
    SqlitePoolOptions::new()
        .max_connections(connections)
        .acquire_timeout(BUSY_TIMEOUT)
        .test_before_acquire(false)
        .connect_lazy_with(options.disable_statement_logging())
}

pub(in crate::store) fn lock(dir: &Path) -> Result<HeldFile, StoreError> {
    std::fs::create_dir_all(dir).map_err(|error| unusable(dir, error))?;
    HeldFile::lock(dir.join(LOCK))
}

/// Checks the log if no process holds the folder; a process that holds it checked the log when it started.
fn refuse_damaged_log_unless_held(dir: &Path) -> Result<(), StoreError> {
    match lock(dir) {
        // The last process to close a log treats what is left of it as complete.
        Ok(_held) => refuse_damaged_log(dir),
        Err(StoreError::Locked { .. }) => Ok(()),
        Err(error) => Err(error),
    }
}

/// Rejects a damaged log, because SQLite would silently drop every commit from the damage on.
fn refuse_damaged_log(dir: &Path) -> Result<(), StoreError> {
    let path = dir.join(LOG);
    let found = write_ahead_log::damage(&path);
    match found.map_err(|error| unusable(&path, error))? {
        None => Ok(()),
        Some(damage) => Err(StoreError::Corrupt { what: damage.to_string() }),
    }
}

/// Empties the log, so that what a crash left torn in it is gone before the next crash. A full disk or a concurrent
/// reader does not prevent the start.
async fn empty_log(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    match sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(connection).await.map_err(opening) {
        Err(error) if error.is_fatal() => Err(error),
        _ => Ok(()),
    }
}

pub(in crate::store) async fn connect(file: &Path) -> Result<SqliteConnection, StoreError> {
    let options = SqliteConnectOptions::new()
        .filename(file)
        .create_if_missing(true)
        // These two take effect in a new file only.
        .page_size(PAGE)
        .auto_vacuum(SqliteAutoVacuum::Incremental)
        .pragma("journal_size_limit", LOG_KEPT)
        .pragma("wal_autocheckpoint", COPIED_AT)
        .pragma("cache_size", CACHE)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(BUSY_TIMEOUT)
        .disable_statement_logging();
    let mut connection = options.connect().await.map_err(opening)?;
    refuse_damaged_schema(&mut connection).await?;
    Ok(connection)
}

/// Rejects a damaged schema: the driver takes column names from the schema, and panics if they are not text.
async fn refuse_damaged_schema(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let statements = "SELECT CAST(coalesce(sql, '') AS BLOB) AS statement FROM sqlite_schema";
    let statements: Vec<Vec<u8>> = sqlx::query_scalar(statements).fetch_all(connection).await.map_err(opening)?;
    if statements.iter().any(|statement| std::str::from_utf8(statement).is_err()) {
        return Err(StoreError::Corrupt { what: "the schema".into() });
    }
    Ok(())
}

async fn refuse_old_engine(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let found: String = sqlx::query_scalar("SELECT sqlite_version()").fetch_one(connection).await.map_err(opening)?;
    let numbers: Vec<u32> = found.split('.').map_while(|number| number.parse().ok()).collect();
    if numbers.as_slice() < OLDEST_ENGINE.as_slice() {
        return Err(StoreError::OldEngine { found });
    }
    Ok(())
}

pub(in crate::store) async fn migrate(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let migrator = migrations::sqlite();
    migrations::refuse_newer(&migrator, version(connection).await?)?;
    migrator.run(connection).await.map_err(|error| migrations::failed(error, Failure::sqlite))
}

/// Returns the version of the schema; 0 if there is none yet.
pub(in crate::store) async fn version(connection: &mut SqliteConnection) -> Result<i64, StoreError> {
    let table = "SELECT count(*) FROM sqlite_schema WHERE name = '_sqlx_migrations'";
    let tables: i64 = sqlx::query_scalar(table).fetch_one(&mut *connection).await.map_err(opening)?;
    if tables == 0 {
        return Ok(0);
    }
    let newest = "SELECT coalesce(max(version), 0) FROM _sqlx_migrations";
    sqlx::query_scalar(newest).fetch_one(connection).await.map_err(opening)
}

/// Ends all leases. The lock shows that earlier holders of leases can no longer write, so their jobs may be claimed at
/// once.
async fn end_leases(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    sqlx::query("UPDATE jobs SET lease_until_ms = ? WHERE state = ?")
        .bind(i64::MIN)
        .bind(JobState::Running.as_str())
        .execute(connection)
        .await
        .map(|_| ())
        .map_err(opening)
}

pub(in crate::store) fn opening(error: sqlx::Error) -> StoreError {
    Failure::sqlite(error).during("opening the store")
}
