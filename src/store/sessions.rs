//! Sessions: where a live investor started.

use futures_util::FutureExt;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};

use super::codec::{Seal, decode_reals, encode_reals, from_sql, to_sql};
use super::error::Failure;
use super::{Store, StoreError};

/// A session to open.
#[derive(Debug, Clone, PartialEq)]
pub struct NewSession {
    pub session: String,
    pub policy: String,
    pub wealth: f64,
    /// The log-returns known at the start.
    pub history: Vec<f64>,
    pub horizon: usize,
    pub created_ms: i64,
}

/// What became of a [`NewSession`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CreateSession {
    Created,
    /// There is no such policy.
    NoPolicy,
    /// The identifier is taken.
    Exists,
}

/// The start of a session, verified against its digest.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionRow {
    pub session: String,
    pub policy: String,
    pub initial_wealth: f64,
    pub initial_history: Vec<f64>,
    pub horizon: usize,
    pub created_ms: i64,
}

/// A session without its history.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionSummary {
    /// Order of creation; the cursor of [`Store::sessions`].
    pub sequence: i64,
    pub session: String,
    pub policy: String,
    pub initial_wealth: f64,
    pub horizon: usize,
    pub created_ms: i64,
    /// Number of periods observed.
    pub observations: usize,
}

impl Store {
    pub async fn create_session(&self, new: NewSession) -> Result<CreateSession, StoreError> {
        self.write("creating a session", move |connection| create(connection, new).boxed()).await
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the row is not what was written.
    pub async fn session(&self, session: &str) -> Result<Option<SessionRow>, StoreError> {
        let row = sqlx::query("SELECT * FROM sessions WHERE session = ?").bind(session).fetch_optional(&self.readers);
        self.read("reading a session", async { row.await?.as_ref().map(SessionRow::from_row).transpose() }).await
    }

    /// At most `limit` sessions, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn sessions(&self, limit: usize, after: Option<i64>) -> Result<Vec<SessionSummary>, StoreError> {
        let rows = sqlx::query(
            "SELECT sequence, session, policy, initial_wealth, horizon, created_ms,
                    (SELECT count(*) FROM observations WHERE observations.session = sessions.session) AS observations
             FROM sessions WHERE sequence < ? ORDER BY sequence DESC LIMIT ?",
        )
        .bind(after.unwrap_or(i64::MAX))
        .bind(to_sql(limit))
        .fetch_all(&self.readers);
        self.read("listing sessions", async { rows.await?.iter().map(SessionSummary::from_row).collect() }).await
    }

    /// Deletes a session and its observations. False where there was none.
    pub async fn delete_session(&self, session: &str) -> Result<bool, StoreError> {
        let session = session.to_owned();
        self.write("deleting a session", move |connection| {
            async move {
                let delete = sqlx::query("DELETE FROM sessions WHERE session = ?").bind(session);
                Ok(delete.execute(connection).await?.rows_affected() > 0)
            }
            .boxed()
        })
        .await
    }

    pub async fn count_sessions(&self) -> Result<u64, StoreError> {
        let count = sqlx::query_scalar("SELECT count(*) FROM sessions").fetch_one(&self.readers);
        self.read("counting sessions", async { Ok(i64::unsigned_abs(count.await?)) }).await
    }
}

async fn create(connection: &mut SqliteConnection, new: NewSession) -> Result<CreateSession, Failure> {
    let policies: i64 = sqlx::query_scalar("SELECT count(*) FROM policies WHERE policy = ?")
        .bind(&new.policy)
        .fetch_one(&mut *connection)
        .await?;
    if policies == 0 {
        return Ok(CreateSession::NoPolicy);
    }
    let row = SessionRow {
        session: new.session,
        policy: new.policy,
        initial_wealth: new.wealth,
        initial_history: new.history,
        horizon: new.horizon,
        created_ms: new.created_ms,
    };
    let seal = row.seal().finish();
    let inserted = sqlx::query(
        "INSERT INTO sessions (session, policy, initial_wealth, initial_history, horizon, created_ms, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (session) DO NOTHING",
    )
    .bind(row.session)
    .bind(row.policy)
    .bind(row.initial_wealth)
    .bind(encode_reals(&row.initial_history))
    .bind(to_sql(row.horizon))
    .bind(row.created_ms)
    .bind(seal)
    .execute(connection)
    .await?;
    Ok(if inserted.rows_affected() > 0 { CreateSession::Created } else { CreateSession::Exists })
}

impl SessionRow {
    fn seal(&self) -> Seal {
        Seal::of("session")
            .text(&self.session)
            .text(&self.policy)
            .real(self.initial_wealth)
            .bytes(&encode_reals(&self.initial_history))
            .integer(to_sql(self.horizon))
            .integer(self.created_ms)
    }

    fn from_row(row: &SqliteRow) -> Result<Self, Failure> {
        let session: String = row.try_get("session")?;
        let what = || format!("the start of session {session}");
        let history = decode_reals(row.try_get("initial_history")?);
        let read = SessionRow {
            policy: row.try_get("policy")?,
            initial_wealth: row.try_get("initial_wealth")?,
            initial_history: history.ok_or_else(|| Failure::Corrupt(what()))?,
            horizon: from_sql(row.try_get("horizon")?)?,
            created_ms: row.try_get("created_ms")?,
            session: session.clone(),
        };
        read.seal().verify(row.try_get("seal")?, what)?;
        Ok(read)
    }
}

impl SessionSummary {
    fn from_row(row: &SqliteRow) -> Result<Self, Failure> {
        Ok(SessionSummary {
            sequence: row.try_get("sequence")?,
            session: row.try_get("session")?,
            policy: row.try_get("policy")?,
            initial_wealth: row.try_get("initial_wealth")?,
            horizon: from_sql(row.try_get("horizon")?)?,
            created_ms: row.try_get("created_ms")?,
            observations: from_sql(row.try_get("observations")?)?,
        })
    }
}
