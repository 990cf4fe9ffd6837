//! A statement, its values and its rows, over either engine.
//!
//! Both engines accept the SQL that is written here, with `$1`. The one difference is handled in this file: PostgreSQL
//! locks the rows a decision depends on. SQLite needs no such locks, because it has only one writer.

use std::borrow::Cow;

use futures_util::TryStreamExt;
use sqlx::postgres::{PgArguments, PgConnection, PgRow};
use sqlx::query::Query as Statement;
use sqlx::sqlite::{SqliteArguments, SqliteConnection, SqliteRow};
use sqlx::{AssertSqlSafe, Database, Decode, Either, Encode, Executor, Postgres, Row as _, Sqlite, Type};

use crate::store::engine::error::Failure;

/// The purpose of a read. Each purpose has connections of its own, so that lists delay neither advice nor probes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::store) enum Purpose {
    /// An answer to an investor, or a job's work.
    Advice,
    /// Data that is listed, shown or followed.
    Lists,
    /// The condition of the store, the queue and the keys.
    Probes,
}

/// A statement and the values of `$1`, `$2` and so on.
pub(in crate::store) struct Query {
    sql: Cow<'static, str>,
    lock: &'static str,
    values: Vec<Value>,
}

pub(in crate::store) enum Value {
    Text(String),
    Integer(i64),
    /// An integer, or NULL.
    Optional(Option<i64>),
    Real(f64),
    /// A real number, or NULL.
    OptionalReal(Option<f64>),
    Bytes(Vec<u8>),
}

pub(in crate::store) fn query(sql: impl Into<Cow<'static, str>>) -> Query {
    Query { sql: sql.into(), lock: "", values: Vec::new() }
}

impl Query {
    pub(in crate::store) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// Locks the rows found against changes and other locks until this transaction ends; waits for current holders.
    pub(in crate::store) fn for_update(self) -> Self {
        Query { lock: " FOR UPDATE", ..self }
    }

    /// Locks like [`Query::for_update`], but lets others add rows that refer to those found.
    pub(in crate::store) fn for_update_but_references(self) -> Self {
        Query { lock: " FOR NO KEY UPDATE", ..self }
    }

    /// Locks like [`Query::for_update`], but skips rows that another transaction holds.
    pub(in crate::store) fn for_update_of_free(self) -> Self {
        Query { lock: " FOR UPDATE SKIP LOCKED", ..self }
    }

    /// Locks the rows found against changes until this transaction ends; others may hold the same lock.
    pub(in crate::store) fn for_share(self) -> Self {
        Query { lock: " FOR SHARE", ..self }
    }

    fn sqlite(self) -> Statement<'static, Sqlite, SqliteArguments> {
        let statement = match self.sql {
            Cow::Borrowed(sql) => sqlx::query(sql),
            Cow::Owned(sql) => sqlx::query(AssertSqlSafe(sql)),
        };
        bound(statement, self.values)
    }

    fn postgres(self) -> Statement<'static, Postgres, PgArguments> {
        let statement = match (self.sql, self.lock) {
            (Cow::Borrowed(sql), "") => sqlx::query(sql),
            (sql, lock) => sqlx::query(AssertSqlSafe(format!("{sql}{lock}"))),
        };
        bound(statement, self.values.into_iter().map(Value::without_nul).collect())
    }
}

fn bound<DB: Database>(
    statement: Statement<'static, DB, DB::Arguments>,
    values: Vec<Value>,
) -> Statement<'static, DB, DB::Arguments>
where
    String: Encode<'static, DB> + Type<DB>,
    i64: Encode<'static, DB> + Type<DB>,
    Option<i64>: Encode<'static, DB> + Type<DB>,
    f64: Encode<'static, DB> + Type<DB>,
    Option<f64>: Encode<'static, DB> + Type<DB>,
    Vec<u8>: Encode<'static, DB> + Type<DB>,
{
    values.into_iter().fold(statement, |statement, value| match value {
        Value::Text(text) => statement.bind(text),
        Value::Integer(integer) => statement.bind(integer),
        Value::Optional(integer) => statement.bind(integer),
        Value::Real(real) => statement.bind(real),
        Value::OptionalReal(real) => statement.bind(real),
        Value::Bytes(bytes) => statement.bind(bytes),
    })
}

impl Value {
    /// Replaces NUL, which PostgreSQL's text cannot hold. No stored name contains NUL, so a name with one still finds
    /// nothing.
    fn without_nul(self) -> Self {
        match self {
            Value::Text(text) if text.contains('\0') => Value::Text(text.replace('\0', "\u{fffd}")),
            other => other,
        }
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Value::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Value::Text(text)
    }
}

impl From<i64> for Value {
    fn from(integer: i64) -> Self {
        Value::Integer(integer)
    }
}

impl From<Option<i64>> for Value {
    fn from(integer: Option<i64>) -> Self {
        Value::Optional(integer)
    }
}

impl From<f64> for Value {
    fn from(real: f64) -> Self {
        Value::Real(real)
    }
}

impl From<Option<f64>> for Value {
    fn from(real: Option<f64>) -> Self {
        Value::OptionalReal(real)
    }
}

impl From<Vec<u8>> for Value {
    fn from(bytes: Vec<u8>) -> Self {
        Value::Bytes(bytes)
    }
}

pub(in crate::store) enum StoreRow {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

/// A type that a column can be read as, from either engine.
pub(in crate::store) trait ReadColumn:
    for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres>
{
}

impl<T> ReadColumn for T where
    T: for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres>
{
}

impl StoreRow {
    pub(in crate::store) fn get<T: ReadColumn>(&self, column: &str) -> Result<T, Failure> {
        match self {
            StoreRow::Sqlite(row) => row.try_get(column).map_err(Failure::sqlite),
            StoreRow::Postgres(row) => row.try_get(column).map_err(Failure::postgres),
        }
    }

    pub(in crate::store) fn length(&self, column: &str) -> Result<usize, Failure> {
        self.get::<i64>(column).map(|length| length.unsigned_abs() as usize)
    }
}

/// A connection used by one operation; for a write, inside its transaction.
pub(in crate::store) enum StoreConnection<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
}

impl StoreConnection<'_> {
    pub(in crate::store) async fn rows(&mut self, query: Query) -> Result<Vec<StoreRow>, Failure> {
        match self {
            StoreConnection::Sqlite(connection) => {
                let mut found = connection.fetch_many(query.sqlite());
                let (mut rows, mut has_ended) = (Vec::new(), false);
                while let Some(next) = found.try_next().await.map_err(Failure::sqlite)? {
                    match next {
                        Either::Left(_) => has_ended = true,
                        Either::Right(row) => rows.push(StoreRow::Sqlite(row)),
                    }
                }
                // If the engine's thread dies, its rows end as if there were no more.
                if has_ended { Ok(rows) } else { Err(Failure::sqlite(sqlx::Error::WorkerCrashed)) }
            }
            StoreConnection::Postgres(connection) => {
                let rows = query.postgres().fetch_all(&mut **connection).await.map_err(Failure::postgres)?;
                Ok(rows.into_iter().map(StoreRow::Postgres).collect())
            }
        }
    }

    /// Returns the first row, if there is one.
    pub(in crate::store) async fn row(&mut self, query: Query) -> Result<Option<StoreRow>, Failure> {
        Ok(self.rows(query).await?.into_iter().next())
    }

    /// Locks the rows a decision depends on until the transaction ends. SQLite needs no lock.
    pub(in crate::store) async fn lock(&mut self, query: Query) -> Result<(), Failure> {
        match self {
            StoreConnection::Sqlite(_) => Ok(()),
            StoreConnection::Postgres(_) => self.rows(query).await.map(drop),
        }
    }

    /// Runs a statement and returns the number of rows changed.
    pub(in crate::store) async fn execute(&mut self, query: Query) -> Result<u64, Failure> {
        match self {
            StoreConnection::Sqlite(connection) => {
                let done = query.sqlite().execute(&mut **connection).await.map_err(Failure::sqlite)?;
                Ok(done.rows_affected())
            }
            StoreConnection::Postgres(connection) => {
                let done = query.postgres().execute(&mut **connection).await.map_err(Failure::postgres)?;
                Ok(done.rows_affected())
            }
        }
    }
}
