//! Moves a folder's rows into a database that replicas share.
//!
//! Both engines have the same tables with columns of the same names, so a row is copied by the types of its columns.
//! The whole move is one transaction: each row is compared with what the database reports that it stored, and each
//! table is counted. If anything differs, nothing is moved. The folder stays as it was.

use std::path::Path;

use futures_util::{StreamExt, TryStreamExt};
use sqlx::sqlite::SqliteConnection;
use sqlx::{AssertSqlSafe, Connection as _};

use crate::store::engine::error::{Failure, StoreError};
use crate::store::engine::migrations;
use crate::store::engine::postgres::{self, PostgresUrl};
use crate::store::engine::query::{StoreConnection, StoreRow, Value, query};
use crate::store::engine::sqlite::opening::{DATABASE, existing, inspect, lock, opening, version};
use crate::store::engine::statement::Statement;
use crate::store::maintenance::check::Inspection;

const DOING: &str = "moving the store";

/// Every table, after those it refers to, and how many of its rows are copied at a time: few if a row may be large.
const TABLES: [(&str, usize); 23] = [
    ("jobs", 100),
    ("job_requests", 1),
    ("job_reports", 1),
    ("turns", 100),
    ("usage", 100),
    ("checkpoints", 1),
    ("policies", 1),
    ("policy_owners", 100),
    ("sessions", 100),
    ("reminders", 100),
    ("links", 100),
    ("idempotency_keys", 100),
    ("labels", 100),
    ("words", 1_000),
    ("entries", 100),
    ("renewals", 100),
    ("access_keys", 100),
    ("audit", 100),
    ("audit_chains", 100),
    ("audit_total", 1),
    ("heartbeat", 1),
    ("subscriptions", 100),
    ("deliveries", 100),
];

/// The type of a column.
#[derive(Debug, Clone, Copy)]
enum ColumnType {
    Text,
    Integer,
    Real,
    Bytes,
    Boolean,
}

/// A value of either engine; a real number is compared by its bits.
#[derive(Debug, Clone, PartialEq)]
enum EngineValue {
    Null,
    Text(String),
    Integer(i64),
    Real(u64),
    Bytes(Vec<u8>),
}

struct CopiedTable {
    name: &'static str,
    at_once: usize,
    columns: Vec<(String, ColumnType)>,
}

/// Moves the rows of the folder `dir`, which no process holds, into an empty database. Reports through `tell` what was
/// moved and verified.
///
/// # Errors
/// Fails if a process holds `dir` or something in it is damaged. Fails too if the database has rows, cannot be reached,
/// or did not store what it was given. Nothing is moved then.
pub async fn relocate(dir: &Path, url: &PostgresUrl, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
    existing(&dir.join(DATABASE))?;
    let held = lock(dir)?;
    Inspection::of_folder(dir).await?.run(tell).await?;
    let mut folder = inspect(dir).await?;
    migrations::require_newest(&migrations::sqlite(), version(&mut folder).await?)?;
    let mut database = postgres::open_new(url).await?;
    let mut transaction = database.begin().await.map_err(|error| Failure::postgres(error).during(DOING))?;
    refuse_unknown_tables(&mut folder).await?;
    let mut connection = StoreConnection::Postgres(&mut transaction);
    let moved = all(&mut folder, &mut connection, tell).await;
    moved.map_err(|failure| failure.during(DOING))?;
    transaction.commit().await.map_err(|error| Failure::postgres(error).during(DOING))?;
    folder.close().await.map_err(opening)?;
    Inspection::of_database(url).await?.run(tell).await?;
    drop(held);
    Ok(())
}

/// Rejects a table that this file does not list, because it would be left behind.
async fn refuse_unknown_tables(folder: &mut SqliteConnection) -> Result<(), StoreError> {
    let tables =
        "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%' AND substr(name, 1, 1) <> '_'";
    let tables: Vec<String> = sqlx::query_scalar(tables).fetch_all(folder).await.map_err(opening)?;
    match tables.into_iter().find(|table| TABLES.iter().all(|(known, _)| known != table)) {
        Some(unknown) => Err(StoreError::NotMoved { reason: format!("this binary cannot move the table {unknown}") }),
        None => Ok(()),
    }
}

async fn all(
    folder: &mut SqliteConnection,
    database: &mut StoreConnection<'_>,
    tell: &mut impl FnMut(String),
) -> Result<(), Failure> {
    for (name, _) in TABLES {
        database.execute(query(format!("LOCK TABLE {name} IN ACCESS EXCLUSIVE MODE"))).await?;
        if !database.rows(query(format!("SELECT 1 AS one FROM {name} LIMIT 1"))).await?.is_empty() {
            return Err(Failure::Corrupt(format!("the database to move to, whose table {name} has rows")));
        }
    }
    for (name, at_once) in TABLES {
        let table = CopiedTable { name, at_once, columns: columns(database, name).await? };
        let rows = table.copy(folder, database).await?;
        table.go_on(folder, database).await?;
        tell(format!("{name}: {rows} rows moved and compared"));
    }
    Ok(())
}

/// Reads the columns of a table from the database.
async fn columns(database: &mut StoreConnection<'_>, table: &str) -> Result<Vec<(String, ColumnType)>, Failure> {
    let find = query(
        "SELECT CAST(column_name AS TEXT) AS name, CAST(data_type AS TEXT) AS type FROM information_schema.columns
         WHERE table_schema = current_schema() AND table_name = $1 ORDER BY ordinal_position",
    );
    let kind = |row: &StoreRow| {
        let (name, kind) = (row.get::<String>("name")?, row.get::<String>("type")?);
        let kind = match kind.as_str() {
            "text" => ColumnType::Text,
            "bigint" => ColumnType::Integer,
            "double precision" => ColumnType::Real,
            "bytea" => ColumnType::Bytes,
            "boolean" => ColumnType::Boolean,
            other => return Err(Failure::Corrupt(format!("a column of the type {other}"))),
        };
        Ok((name, kind))
    };
    database.rows(find.bind(table)).await?.iter().map(kind).collect()
}

impl CopiedTable {
    fn names(&self) -> String {
        self.columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// Copies every row, compares it with what the database stored, and returns the number of rows.
    async fn copy(&self, folder: &mut SqliteConnection, database: &mut StoreConnection<'_>) -> Result<usize, Failure> {
        let select = format!("SELECT {} FROM {}", self.names(), self.name);
        let rows = sqlx::query(AssertSqlSafe(select)).fetch(folder).map_err(Failure::sqlite);
        let cells = rows.map(|row| self.cells(&StoreRow::Sqlite(row?)));
        let mut chunks = cells.try_chunks(self.at_once);
        let mut copied = 0;
        while let Some(chunk) = chunks.next().await {
            let chunk = chunk.map_err(|error| error.1)?;
            let stored = database.rows(self.insert(&chunk).query()).await?;
            let stored = stored.iter().map(|row| self.cells(row)).collect::<Result<Vec<_>, _>>()?;
            if stored != chunk {
                return Err(Failure::Corrupt(format!("the copy of the table {}", self.name)));
            }
            copied += chunk.len();
        }
        let count = database.row(query(format!("SELECT count(*) AS rows FROM {}", self.name))).await?;
        match count.map_or(Ok(0), |row| row.length("rows"))? {
            count if count == copied => Ok(copied),
            count => Err(Failure::Corrupt(format!("{count} of {copied} rows of the table {}", self.name))),
        }
    }

    fn insert(&self, rows: &[Vec<EngineValue>]) -> Statement {
        let names = self.names();
        let mut insert = Statement::of(&format!("INSERT INTO {} ({names}) OVERRIDING SYSTEM VALUE VALUES ", self.name));
        for (place, row) in rows.iter().enumerate() {
            insert.and(if place == 0 { "(" } else { ", (" }, []);
            for (place, (cell, (_, kind))) in row.iter().zip(&self.columns).enumerate() {
                if place > 0 {
                    insert.and(", ", []);
                }
                let value: Value = match cell.clone() {
                    EngineValue::Null => {
                        insert.and("NULL", []);
                        continue;
                    }
                    EngineValue::Text(text) => text.into(),
                    EngineValue::Integer(integer) => integer.into(),
                    EngineValue::Real(bits) => f64::from_bits(bits).into(),
                    EngineValue::Bytes(bytes) => bytes.into(),
                };
                insert.and(if matches!(kind, ColumnType::Boolean) { "? <> 0" } else { "?" }, [value]);
            }
            insert.and(")", []);
        }
        insert.and(&format!(" RETURNING {names}"), []);
        insert
    }

    fn cells(&self, row: &StoreRow) -> Result<Vec<EngineValue>, Failure> {
        self.columns.iter().map(|(name, kind)| cell(row, name, *kind)).collect()
    }

    /// Advances the sequence, so that numbers already used are not used again.
    async fn go_on(&self, folder: &mut SqliteConnection, database: &mut StoreConnection<'_>) -> Result<(), Failure> {
        let last = "SELECT seq FROM sqlite_sequence WHERE name = ?";
        let last: Option<i64> =
            sqlx::query_scalar(last).bind(self.name).fetch_optional(folder).await.map_err(Failure::sqlite)?;
        let Some(last) = last.filter(|last| *last > 0) else { return Ok(()) };
        let go_on = query("SELECT setval(pg_get_serial_sequence($1, 'sequence'), $2) AS last");
        database.rows(go_on.bind(self.name).bind(last)).await.map(drop)
    }
}

fn cell(row: &StoreRow, name: &str, kind: ColumnType) -> Result<EngineValue, Failure> {
    let cell = match kind {
        ColumnType::Text => row.get::<Option<String>>(name)?.map(EngineValue::Text),
        ColumnType::Integer => row.get::<Option<i64>>(name)?.map(EngineValue::Integer),
        ColumnType::Real => row.get::<Option<f64>>(name)?.map(|real| EngineValue::Real(real.to_bits())),
        ColumnType::Bytes => row.get::<Option<Vec<u8>>>(name)?.map(EngineValue::Bytes),
        ColumnType::Boolean => row.get::<Option<bool>>(name)?.map(|is| EngineValue::Integer(is.into())),
    };
    Ok(cell.unwrap_or(EngineValue::Null))
}
