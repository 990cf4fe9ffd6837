//! Opening a folder: the lock, the engine's age, the schema, the leases of the dead, the connections.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{ConnectOptions, SqliteConnection};

use crate::store::error::{Failure, StoreError};
use crate::store::job_state::JobState;
use crate::store::migrations;

const DATABASE: &str = "ballast.sqlite";
const LOCK: &str = "ballast.lock";
/// The first release without the reset bug of the write-ahead log.
const OLDEST_ENGINE: [u32; 3] = [3, 51, 3];
/// A reader waits this long for recovery after a crash; writers never meet.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);
/// Each read connection is a thread; reads are short.
const READERS: u32 = 4;

/// A folder that is ours, its schema up to date.
pub(super) struct Opened {
    pub lock: File,
    pub writer: SqliteConnection,
    pub readers: SqlitePool,
}

pub(super) async fn open(dir: &Path) -> Result<Opened, StoreError> {
    let lock = lock(dir)?;
    let file = dir.join(DATABASE);
    let mut writer = connect(&file).await?;
    refuse_old_engine(&mut writer).await?;
    migrate(&mut writer).await?;
    end_leases(&mut writer).await?;
    let options = SqliteConnectOptions::new().filename(&file).read_only(true).busy_timeout(BUSY_TIMEOUT);
    let readers = SqlitePoolOptions::new()
        .max_connections(READERS)
        .acquire_timeout(BUSY_TIMEOUT)
        .test_before_acquire(false)
        .connect_lazy_with(options.disable_statement_logging());
    Ok(Opened { lock, writer, readers })
}

fn lock(dir: &Path) -> Result<File, StoreError> {
    let folder = |path: &Path, error| StoreError::Folder { path: PathBuf::from(path), source: Arc::new(error) };
    std::fs::create_dir_all(dir).map_err(|error| folder(dir, error))?;
    let path = dir.join(LOCK);
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(|error| folder(&path, error))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StoreError::Locked { path }),
        Err(TryLockError::Error(error)) => Err(folder(&path, error)),
    }
}

async fn connect(file: &Path) -> Result<SqliteConnection, StoreError> {
    SqliteConnectOptions::new()
        .filename(file)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(BUSY_TIMEOUT)
        .disable_statement_logging()
        .connect()
        .await
        .map_err(opening)
}

async fn refuse_old_engine(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let found: String = sqlx::query_scalar("SELECT sqlite_version()").fetch_one(connection).await.map_err(opening)?;
    let numbers: Vec<u32> = found.split('.').map_while(|number| number.parse().ok()).collect();
    if numbers.as_slice() < OLDEST_ENGINE.as_slice() {
        return Err(StoreError::OldEngine { found });
    }
    Ok(())
}

async fn migrate(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let migrator = migrations::sqlite();
    let table = "SELECT count(*) FROM sqlite_schema WHERE name = '_sqlx_migrations'";
    let tables: i64 = sqlx::query_scalar(table).fetch_one(&mut *connection).await.map_err(opening)?;
    if tables > 0 {
        let newest = "SELECT coalesce(max(version), 0) FROM _sqlx_migrations";
        let found = sqlx::query_scalar(newest).fetch_one(&mut *connection).await.map_err(opening)?;
        migrations::refuse_newer(&migrator, found)?;
    }
    migrator.run(connection).await.map_err(|error| migrations::failed(error, Failure::Sqlite))
}

/// The lock shows that whoever held a lease can no longer write: its jobs may be claimed at once.
async fn end_leases(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    sqlx::query("UPDATE jobs SET lease_until_ms = ? WHERE state = ?")
        .bind(i64::MIN)
        .bind(JobState::Running.as_str())
        .execute(connection)
        .await
        .map(|_| ())
        .map_err(opening)
}

fn opening(error: sqlx::Error) -> StoreError {
    Failure::Sqlite(error).during("opening the store")
}
