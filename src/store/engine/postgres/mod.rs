//! A PostgreSQL database that any number of processes share.
//!
//! Isolation is `READ COMMITTED`: each decision locks the row it depends on, then reads what it needs by a separate
//! statement. One statement that locks and reads would not do: after waiting for the lock, it would still read the
//! state from when it began. Only an observation is first tried without a lock, by one statement, which the keys of its
//! table reject if another came first.
//!
//! No wait is unbounded. PostgreSQL bounds statements, waits for locks and transactions whose client fell silent (a
//! stopped worker must not hold a job's row). This side bounds whole operations, in case the server stops answering. A
//! connection that hit such a bound is closed, because its state is unknown. An operation cut off during its commit may
//! have been committed; callers find out by repeating it, which every operation here allows.

mod url;

use std::time::Duration;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnectOptions, PgConnection, PgPool, PgPoolOptions};
use sqlx::{ConnectOptions, Connection as _, Postgres};

use crate::store::engine::error::{Failure, StoreError};
use crate::store::engine::migrations;
use crate::store::engine::query::{Purpose, Query, StoreConnection, StoreRow, query};

pub use url::{PostgresUrl, UrlError};

/// Connections of one process, ten in all. A server allows 100 by default: a few replicas, and some for an operator.
const WORK_CONNECTIONS: u32 = 6;
const LIST_CONNECTIONS: u32 = 3;
const PROBE_CONNECTIONS: u32 = 1;
/// A request waits this long for a connection before it is rejected with advice to retry.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// Longer than the server's own bounds below, and within the time of a request.
const OPERATION_TIMEOUT: Duration = Duration::from_secs(20);
/// The server's bounds, for every connection. Some run databases with `synchronous_commit` off, which would break the
/// first promise; a setting that waits for standbys stays.
const SETTINGS: &str = "SELECT set_config('statement_timeout', '15s', false),
    set_config('lock_timeout', '3s', false),
    set_config('idle_in_transaction_session_timeout', '5s', false),
    set_config('synchronous_commit', CASE current_setting('synchronous_commit') WHEN 'off' THEN 'on'
               ELSE current_setting('synchronous_commit') END, false)";

#[derive(Clone)]
pub(in crate::store) struct Database {
    /// For writes, and for reads behind advice.
    work: PgPool,
    lists: PgPool,
    probes: PgPool,
}

impl Database {
    pub(in crate::store) async fn connect(url: &PostgresUrl) -> Result<Database, StoreError> {
        let options = url.options().disable_statement_logging();
        // Without the time limits of the pool, because a migration may take long.
        let mut connection = connect(&options).await?;
        migrate(&mut connection).await?;
        // Everything is committed, so an error while closing changes nothing.
        let _ = connection.close().await;
        Ok(Database {
            work: pool(WORK_CONNECTIONS, &options),
            lists: pool(LIST_CONNECTIONS, &options),
            probes: pool(PROBE_CONNECTIONS, &options),
        })
    }

    pub(in crate::store) async fn ping(&self) -> Result<(), StoreError> {
        let doing = "answering a ping";
        let rows = self
            .read(Purpose::Probes, doing, query("SELECT pg_is_in_recovery() AS standby, EXISTS (SELECT 1 FROM jobs)"))
            .await?;
        match rows.first().map(|row| row.get("standby")).transpose().map_err(|failure| failure.during(doing))? {
            Some(true) => Err(StoreError::Unavailable { doing, source: None }),
            _ => Ok(()),
        }
    }

    pub(in crate::store) async fn time(&self) -> Result<i64, StoreError> {
        let doing = "reading the server's clock";
        let clock = query("SELECT CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT) AS time_ms");
        let rows = self.read(Purpose::Advice, doing, clock).await?;
        let time = rows.first().ok_or(Failure::postgres(sqlx::Error::RowNotFound)).and_then(|row| row.get("time_ms"));
        time.map_err(|failure| failure.during(doing))
    }

    /// Returns the size of the database, in bytes.
    pub(in crate::store) async fn size(&self) -> Result<u64, StoreError> {
        let doing = "measuring the database";
        let size = query("SELECT pg_database_size(current_database()) AS size");
        let rows = self.read(Purpose::Probes, doing, size).await?;
        let size = rows.first().ok_or(Failure::postgres(sqlx::Error::RowNotFound)).and_then(|row| row.get("size"));
        size.map(i64::unsigned_abs).map_err(|failure| failure.during(doing))
    }

    pub(in crate::store) async fn close(&self) {
        for pool in [&self.work, &self.lists, &self.probes] {
            pool.close().await;
        }
    }

    /// Runs `work` in a transaction and returns after its commit.
    pub(in crate::store) async fn write<T, W>(&self, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(StoreConnection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        self.bounded(&self.work, doing, |connection| {
            async move {
                let mut transaction = connection.begin().await.map_err(Failure::postgres)?;
                let answer = work(StoreConnection::Postgres(&mut transaction)).await;
                // If the transaction were only dropped, a failed one would keep its locks for a while after the answer.
                match answer {
                    Ok(_) => transaction.commit().await,
                    Err(_) => transaction.rollback().await,
                }
                .map_err(Failure::postgres)?;
                answer
            }
            .boxed()
        })
        .await
    }

    pub(in crate::store) async fn read(
        &self,
        purpose: Purpose,
        doing: &'static str,
        query: Query,
    ) -> Result<Vec<StoreRow>, StoreError> {
        let pool = match purpose {
            Purpose::Advice => &self.work,
            Purpose::Lists => &self.lists,
            Purpose::Probes => &self.probes,
        };
        self.bounded(pool, doing, |connection| {
            async move { StoreConnection::Postgres(connection).rows(query).await }.boxed()
        })
        .await
    }

    /// Runs one statement as a transaction of its own, and returns the number of rows it changed.
    pub(in crate::store) async fn execute(&self, doing: &'static str, query: Query) -> Result<u64, StoreError> {
        self.bounded(&self.work, doing, |connection| {
            async move { StoreConnection::Postgres(connection).execute(query).await }.boxed()
        })
        .await
    }

    /// Runs `work` on a connection for at most [`OPERATION_TIMEOUT`]; a connection that became unavailable is not used
    /// again.
    async fn bounded<T>(
        &self,
        pool: &PgPool,
        doing: &'static str,
        work: impl for<'c> FnOnce(&'c mut PoolConnection<Postgres>) -> BoxFuture<'c, Result<T, Failure>>,
    ) -> Result<T, StoreError> {
        let acquired = pool.acquire().await;
        let mut connection = acquired.map_err(|error| Failure::postgres(error).during(doing))?;
        let result = match tokio::time::timeout(OPERATION_TIMEOUT, work(&mut connection)).await {
            Ok(result) => result.map_err(|failure| failure.during(doing)),
            Err(_) => Err(StoreError::Unavailable { doing, source: None }),
        };
        if matches!(result, Err(StoreError::Unavailable { .. })) {
            drop(connection.detach());
        }
        result
    }
}

fn pool(connections: u32, options: &PgConnectOptions) -> PgPool {
    PgPoolOptions::new()
        .max_connections(connections)
        .acquire_timeout(CONNECT_TIMEOUT)
        .after_connect(|connection, _| {
            async move { sqlx::query(SETTINGS).execute(connection).await.map(|_| ()) }.boxed()
        })
        .connect_lazy_with(options.clone())
}

const OPENING: &str = "opening the database";

async fn connect(options: &PgConnectOptions) -> Result<PgConnection, StoreError> {
    match tokio::time::timeout(CONNECT_TIMEOUT, options.connect()).await {
        Ok(connected) => connected.map_err(opening),
        Err(_) => Err(StoreError::Unavailable { doing: OPENING, source: None }),
    }
}

/// Opens one read-only connection to the database.
pub(in crate::store) async fn inspect(url: &PostgresUrl) -> Result<PgConnection, StoreError> {
    let mut connection = connect(&url.options().disable_statement_logging()).await?;
    let read_only = "SET default_transaction_read_only = on";
    sqlx::query(read_only).execute(&mut connection).await.map_err(opening)?;
    Ok(connection)
}

/// Opens one connection to the database, and creates its schema or brings it up to date.
pub(in crate::store) async fn open_new(url: &PostgresUrl) -> Result<PgConnection, StoreError> {
    let mut connection = connect(&url.options().disable_statement_logging()).await?;
    migrate(&mut connection).await?;
    Ok(connection)
}

/// Returns the version of the schema; 0 if there is none yet.
pub(in crate::store) async fn version(connection: &mut PgConnection) -> Result<i64, StoreError> {
    let table = "SELECT to_regclass('_sqlx_migrations') IS NOT NULL";
    if !sqlx::query_scalar(table).fetch_one(&mut *connection).await.map_err(opening)? {
        return Ok(0);
    }
    let newest = "SELECT coalesce(max(version), 0) FROM _sqlx_migrations";
    sqlx::query_scalar(newest).fetch_one(connection).await.map_err(opening)
}

async fn migrate(connection: &mut PgConnection) -> Result<(), StoreError> {
    let migrator = migrations::postgres();
    migrations::refuse_newer(&migrator, version(connection).await?)?;
    migrator.run(connection).await.map_err(|error| migrations::failed(error, Failure::postgres))
}

fn opening(error: sqlx::Error) -> StoreError {
    Failure::postgres(error).during(OPENING)
}
