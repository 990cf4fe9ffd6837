//! Observations: append-only, numbered by period from 1, each stored exactly once.

use std::sync::LazyLock;

use futures_util::FutureExt;

use super::codec::{Seal, from_sql, to_sql};
use super::error::Failure;
use super::head::Head;
use super::postgres::Database;
use super::query::{Connection, Query, Row, query};
use super::{Engine, Store, StoreError};

/// One period's return and what was answered to it; as read, verified against its seal.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationRow {
    pub session: String,
    pub period: usize,
    /// Hash of what the user reported: tells a repeat from other content under the same period.
    pub content_hash: String,
    pub log_return: f64,
    pub executed_allocation: f64,
    pub advised_allocation: f64,
    pub wealth_after: f64,
    pub answer_json: String,
    pub created_ms: i64,
    /// The name of the key that reported it; empty where none was asked for.
    pub key: String,
}

/// What became of an observation to append.
#[derive(Debug, Clone, PartialEq)]
pub enum Append {
    Appended,
    /// The period was reported with the same content: the first answer.
    Repeated {
        answer_json: String,
    },
    /// The period was reported with other content.
    Conflict,
    /// Not the period after the last.
    OutOfOrder {
        expected: usize,
    },
    NoSession,
}

impl Store {
    /// Appends the period after the last, or says why not; decided and written in one transaction.
    pub async fn append_observation(&self, new: ObservationRow) -> Result<Append, StoreError> {
        match &self.engine {
            Engine::Sqlite(folder) => folder.append(new).await,
            Engine::Postgres(database) => append_shared(database, new).boxed().await,
        }
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the row is not what was written.
    pub async fn observation(&self, session: &str, period: usize) -> Result<Option<ObservationRow>, StoreError> {
        let find = query("SELECT * FROM observations WHERE session = $1 AND period = $2");
        let find = find.bind(session).bind(to_sql(period));
        self.read("reading an observation", find, |rows| rows.first().map(ObservationRow::from_row).transpose()).await
    }

    /// Every observation of the session, ascending by period. `None` where there is no such session, by the same
    /// statement: a session that is deleted meanwhile is never one without observations.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] where a row is not what was written or a period is missing.
    pub async fn observations(&self, session: &str) -> Result<Option<Vec<ObservationRow>>, StoreError> {
        self.read("reading observations", all_of(session), |rows| numbered(session, rows)).await
    }
}

pub(super) fn all_of(session: &str) -> Query {
    let all = query(
        "SELECT observations.* FROM sessions LEFT JOIN observations ON observations.session = sessions.session
         WHERE sessions.session = $1 ORDER BY observations.period",
    );
    all.bind(session)
}

/// What [`all_of`] finds, each row verified and none missing before the last.
pub(super) fn numbered(session: &str, rows: &[Row]) -> Result<Option<Vec<ObservationRow>>, Failure> {
    let Some(first) = rows.first() else { return Ok(None) };
    if first.get::<Option<i64>>("period")?.is_none() {
        return Ok(Some(Vec::new()));
    }
    let rows: Vec<_> = rows.iter().map(ObservationRow::from_row).collect::<Result<_, Failure>>()?;
    match rows.iter().zip(1..).find(|(row, period)| row.period != *period) {
        None => Ok(Some(rows)),
        Some((_, period)) => Err(Failure::Corrupt(format!("period {period} of session {session}"))),
    }
}

/// Appends by one statement, which commits by itself: two that append the same period, or one beside a deletion, meet at the
/// table's keys. Why a period is not appended is found out under the lock of its session.
async fn append_shared(database: &Database, new: ObservationRow) -> Result<Append, StoreError> {
    match database.execute(APPENDING, bind_row(query(INSERT_ONE.as_str()), &new)).await {
        Ok(rows) if rows > 0 => Ok(Append::Appended),
        Ok(_) | Err(StoreError::Refused { .. }) => {
            database.write(APPENDING, move |connection| append(connection, new).boxed()).await
        }
        Err(error) => Err(error),
    }
}

/// What appending calls itself in errors.
pub(super) const APPENDING: &str = "appending an observation";

/// The row is inserted by a statement that decides itself whether it is the next one; why it was not is found out after.
/// It changes rows by that statement only.
pub(super) async fn append(mut connection: Connection<'_>, new: ObservationRow) -> Result<Append, Failure> {
    let connection = &mut connection;
    let session = query("SELECT sequence FROM sessions WHERE session = $1").bind(new.session.as_str());
    connection.lock(session.for_update()).await?;
    if insert_next(connection, &new).await? {
        return Ok(Append::Appended);
    }
    refused(connection, &new).await
}

/// Why a period was not inserted.
async fn refused(connection: &mut Connection<'_>, new: &ObservationRow) -> Result<Append, Failure> {
    let session = query("SELECT sequence FROM sessions WHERE session = $1").bind(new.session.as_str());
    if connection.row(session).await?.is_none() {
        return Ok(Append::NoSession);
    }
    let last = query("SELECT coalesce(max(period), 0) AS period FROM observations WHERE session = $1");
    let last = connection.row(last.bind(new.session.as_str())).await?.map_or(Ok(0), |row| row.get("period"))?;
    let expected = from_sql(last)? + 1;
    if (1..expected).contains(&new.period) {
        return repeated(connection, new).await;
    }
    Ok(Append::OutOfOrder { expected })
}

/// What a period reported before answers.
async fn repeated(connection: &mut Connection<'_>, new: &ObservationRow) -> Result<Append, Failure> {
    let earlier = query("SELECT * FROM observations WHERE session = $1 AND period = $2");
    let earlier = connection.row(earlier.bind(new.session.as_str()).bind(to_sql(new.period))).await?;
    let missing = || Failure::Corrupt(format!("period {} of session {}", new.period, new.session));
    let earlier = ObservationRow::from_row(&earlier.ok_or_else(missing)?)?;
    Ok(if earlier.content_hash == new.content_hash {
        Append::Repeated { answer_json: earlier.answer_json }
    } else {
        Append::Conflict
    })
}

const NAMES: &str = "session, period, content_hash, log_return, executed_allocation, advised_allocation,
                     wealth_after, answer_json, created_ms, access_key, seal";
const COLUMNS: usize = 11;
/// The period after the last that `new.session` has.
const NEXT: &str = "(SELECT coalesce(max(period), 0) + 1 FROM observations WHERE observations.session = new.session)";

/// Inserts a row whose period is the one after the last of a session that exists.
static INSERT_ONE: LazyLock<String> = LazyLock::new(|| {
    let numbers: Vec<String> = (1..=COLUMNS).map(|column| format!("${column}")).collect();
    format!(
        "WITH new ({NAMES}) AS (VALUES ({}))
         INSERT INTO observations ({NAMES}) SELECT new.* FROM new CROSS JOIN sessions
         WHERE sessions.session = new.session AND new.period = {NEXT}",
        numbers.join(", ")
    )
});

/// Powers of two, so that any number of rows finds a statement of less than twice its size.
const SIZES: usize = 7;
/// Rows that one statement takes at most.
pub(super) const ROWS_AT_ONCE: usize = 1 << (SIZES - 1);

static INSERT_MANY: [LazyLock<String>; SIZES] = [
    LazyLock::new(|| insert_all(1)),
    LazyLock::new(|| insert_all(2)),
    LazyLock::new(|| insert_all(4)),
    LazyLock::new(|| insert_all(8)),
    LazyLock::new(|| insert_all(16)),
    LazyLock::new(|| insert_all(32)),
    LazyLock::new(|| insert_all(64)),
];

/// Inserts so many rows of SQLite, or none: one that is not the next of its session has no seal, which the table refuses,
/// and a session that does not exist is refused as what it refers to. Values not bound are NULL, a row of them is none.
fn insert_all(rows: usize) -> String {
    let sealed = NAMES.replace("seal", &format!("CASE period WHEN {NEXT} THEN seal END"));
    let row = format!("({})", ["?"; COLUMNS].join(", "));
    format!(
        "INSERT INTO observations ({NAMES}) WITH new ({NAMES}) AS (VALUES {})
         SELECT {sealed} FROM new WHERE session IS NOT NULL",
        vec![row; rows].join(", ")
    )
}

/// Inserts up to [`ROWS_AT_ONCE`] rows, all of them or none, by one statement of SQLite.
///
/// # Errors
/// Also where not all of them are the next ones of sessions that exist.
pub(super) async fn append_all(connection: &mut Connection<'_>, new: &[&ObservationRow]) -> Result<(), Failure> {
    let size = new.len().next_power_of_two().trailing_zeros() as usize;
    let insert = new.iter().fold(query(INSERT_MANY[size].as_str()), |insert, new| bind_row(insert, new));
    connection.execute(insert).await.map(drop)
}

/// Inserts the period where it is the one after the last of a session that exists.
async fn insert_next(connection: &mut Connection<'_>, new: &ObservationRow) -> Result<bool, Failure> {
    Ok(connection.execute(bind_row(query(INSERT_ONE.as_str()), new)).await? > 0)
}

fn bind_row(insert: Query, new: &ObservationRow) -> Query {
    insert
        .bind(new.session.as_str())
        .bind(to_sql(new.period))
        .bind(new.content_hash.as_str())
        .bind(new.log_return)
        .bind(new.executed_allocation)
        .bind(new.advised_allocation)
        .bind(new.wealth_after)
        .bind(new.answer_json.as_str())
        .bind(new.created_ms)
        .bind(new.key.as_str())
        .bind(new.seal().finish())
}

impl ObservationRow {
    /// The head of its session where this is the last observation.
    pub fn head(&self) -> Head {
        Head { observed: self.period, seal: self.seal().finish() }
    }

    fn seal(&self) -> Seal {
        Seal::of("observation")
            .text(&self.session)
            .integer(to_sql(self.period))
            .text(&self.content_hash)
            .real(self.log_return)
            .real(self.executed_allocation)
            .real(self.advised_allocation)
            .real(self.wealth_after)
            .text(&self.answer_json)
            .integer(self.created_ms)
            .text(&self.key)
    }

    pub(super) fn from_row(row: &Row) -> Result<Self, Failure> {
        let read = ObservationRow {
            session: row.get("session")?,
            period: from_sql(row.get("period")?)?,
            content_hash: row.get("content_hash")?,
            log_return: row.get("log_return")?,
            executed_allocation: row.get("executed_allocation")?,
            advised_allocation: row.get("advised_allocation")?,
            wealth_after: row.get("wealth_after")?,
            answer_json: row.get("answer_json")?,
            created_ms: row.get("created_ms")?,
            key: row.get("access_key")?,
        };
        let seal: Vec<u8> = row.get("seal")?;
        read.seal().verify(&seal, || format!("period {} of session {}", read.period, read.session))?;
        Ok(read)
    }
}
