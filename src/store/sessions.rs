//! Sessions: where a live investor started.

use futures_util::FutureExt;

use super::audit::{self, Actor, Deed};
use super::codec::{Seal, decode_reals, encode_reals, from_sql, to_sql};
use super::error::Failure;
use super::query::{Connection, Row, query};
use super::tenant::Tenant;
use super::{Store, StoreError, policies};

/// A session to open.
#[derive(Debug, Clone, PartialEq)]
pub struct NewSession {
    pub session: String,
    pub tenant: Tenant,
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
    /// The tenant has no such policy.
    NoPolicy,
    /// The identifier is taken.
    Exists,
}

/// The start of a session, verified against its digest.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionRow {
    pub session: String,
    pub tenant: Tenant,
    pub policy: String,
    pub initial_wealth: f64,
    pub initial_history: Vec<f64>,
    pub horizon: usize,
    pub created_ms: i64,
}

/// What tells whether a session is still what it was: how far it is, and the seal of its last row.
///
/// Rows are only appended, and a seal covers the time its row was made: equal heads mean equal sessions, even where the
/// database was restored from a copy and went on differently.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    pub observed: usize,
    pub(super) seal: Vec<u8>,
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
        let actor = self.actor.clone();
        self.write("creating a session", move |connection| create(connection, new, actor).boxed()).await
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the row is not what was written.
    pub async fn session(&self, session: &str) -> Result<Option<SessionRow>, StoreError> {
        let find = query("SELECT * FROM sessions WHERE session = $1").bind(session);
        self.read("reading a session", find, |rows| rows.first().map(SessionRow::from_row).transpose()).await
    }

    /// The head of a session: where it is the one a replay gave, that replay is still the session.
    pub async fn head(&self, session: &str) -> Result<Option<Head>, StoreError> {
        let last = query(
            "SELECT sessions.seal AS start_seal, observations.period, observations.seal
             FROM sessions LEFT JOIN observations ON observations.session = sessions.session
             WHERE sessions.session = $1 ORDER BY observations.period DESC LIMIT 1",
        );
        self.read("reading the head of a session", last.bind(session), |rows| {
            let Some(row) = rows.first() else { return Ok(None) };
            Ok(Some(match row.get::<Option<i64>>("period")? {
                Some(period) => Head { observed: from_sql(period)?, seal: row.get("seal")? },
                None => Head { observed: 0, seal: row.get("start_seal")? },
            }))
        })
        .await
    }

    /// At most `limit` sessions of a tenant, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn sessions(
        &self,
        tenant: &Tenant,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<SessionSummary>, StoreError> {
        let page = query(
            "SELECT sequence, session, policy, initial_wealth, horizon, created_ms,
                    (SELECT count(*) FROM observations WHERE observations.session = sessions.session) AS observations
             FROM sessions WHERE tenant = $1 AND sequence < $2 ORDER BY sequence DESC LIMIT $3",
        );
        let page = page.bind(tenant.as_str()).bind(after.unwrap_or(i64::MAX)).bind(to_sql(limit));
        self.read("listing sessions", page, |rows| rows.iter().map(SessionSummary::from_row).collect()).await
    }

    /// Deletes a session of a tenant and its observations. False where there was none.
    pub async fn delete_session(&self, tenant: &Tenant, session: &str) -> Result<bool, StoreError> {
        let (tenant, session, actor) = (tenant.clone(), session.to_owned(), self.actor.clone());
        self.write("deleting a session", move |connection| delete(connection, tenant, session, actor).boxed()).await
    }

    pub async fn count_sessions(&self) -> Result<u64, StoreError> {
        let count = query("SELECT count(*) AS sessions FROM sessions");
        let counted = |rows: &[Row]| rows.first().map_or(Ok(0), |row| row.get("sessions"));
        self.read("counting sessions", count, counted).await.map(i64::unsigned_abs)
    }
}

/// The policy stays locked until the session is there: it cannot be deleted in between.
async fn create(mut connection: Connection<'_>, new: NewSession, actor: Actor) -> Result<CreateSession, Failure> {
    let policy = query("SELECT sequence FROM policies WHERE policy = $1").bind(new.policy.as_str());
    if connection.row(policy.for_share()).await?.is_none()
        || !policies::is_owned(&mut connection, &new.tenant, &new.policy).await?
    {
        return Ok(CreateSession::NoPolicy);
    }
    let row = SessionRow::from(new);
    let insert = query(
        "INSERT INTO sessions (session, policy, initial_wealth, initial_history, horizon, created_ms, seal, tenant)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT (session) DO NOTHING",
    );
    let seal = row.seal().finish();
    let insert = insert
        .bind(row.session.as_str())
        .bind(row.policy.as_str())
        .bind(row.initial_wealth)
        .bind(encode_reals(&row.initial_history))
        .bind(to_sql(row.horizon))
        .bind(row.created_ms)
        .bind(seal)
        .bind(row.tenant.as_str());
    if connection.execute(insert).await? == 0 {
        return Ok(CreateSession::Exists);
    }
    let outcome = format!("opened under policy {}", row.policy);
    audit::record(&mut connection, &actor, &row.tenant, Deed::OpenSession, &row.session, &outcome).await?;
    Ok(CreateSession::Created)
}

/// The entry says how many observations went with the session.
async fn delete(
    mut connection: Connection<'_>,
    tenant: Tenant,
    session: String,
    actor: Actor,
) -> Result<bool, Failure> {
    let connection = &mut connection;
    let count = query("SELECT count(*) AS observations FROM observations WHERE session = $1").bind(session.as_str());
    let observations: i64 = connection.row(count).await?.map_or(Ok(0), |row| row.get("observations"))?;
    let delete = query("DELETE FROM sessions WHERE session = $1 AND tenant = $2");
    if connection.execute(delete.bind(session.as_str()).bind(tenant.as_str())).await? == 0 {
        return Ok(false);
    }
    let outcome = format!("deleted, with {observations} observations");
    audit::record(connection, &actor, &tenant, Deed::DeleteSession, &session, &outcome).await?;
    Ok(true)
}

impl From<NewSession> for SessionRow {
    fn from(new: NewSession) -> Self {
        SessionRow {
            session: new.session,
            tenant: new.tenant,
            policy: new.policy,
            initial_wealth: new.wealth,
            initial_history: new.history,
            horizon: new.horizon,
            created_ms: new.created_ms,
        }
    }
}

impl SessionRow {
    /// The head of the session before its first observation.
    pub fn head(&self) -> Head {
        Head { observed: 0, seal: self.seal().finish() }
    }

    fn seal(&self) -> Seal {
        Seal::of("session")
            .text(&self.session)
            .text(self.tenant.as_str())
            .text(&self.policy)
            .real(self.initial_wealth)
            .bytes(&encode_reals(&self.initial_history))
            .integer(to_sql(self.horizon))
            .integer(self.created_ms)
    }

    pub(super) fn from_row(row: &Row) -> Result<Self, Failure> {
        let session: String = row.get("session")?;
        let what = || format!("the start of session {session}");
        let history = decode_reals(&row.get::<Vec<u8>>("initial_history")?);
        let read = SessionRow {
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            policy: row.get("policy")?,
            initial_wealth: row.get("initial_wealth")?,
            initial_history: history.ok_or_else(|| Failure::Corrupt(what()))?,
            horizon: from_sql(row.get("horizon")?)?,
            created_ms: row.get("created_ms")?,
            session: session.clone(),
        };
        read.seal().verify(&row.get::<Vec<u8>>("seal")?, what)?;
        Ok(read)
    }
}

impl SessionSummary {
    fn from_row(row: &Row) -> Result<Self, Failure> {
        Ok(SessionSummary {
            sequence: row.get("sequence")?,
            session: row.get("session")?,
            policy: row.get("policy")?,
            initial_wealth: row.get("initial_wealth")?,
            horizon: from_sql(row.get("horizon")?)?,
            created_ms: row.get("created_ms")?,
            observations: from_sql(row.get("observations")?)?,
        })
    }
}
