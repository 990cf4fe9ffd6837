//! Sessions: the start of each live investor.
//!
//! Its modules hold the entries of sessions, how a change is noticed, and the lists in which sessions are found.

pub(super) mod attention;
pub(super) mod entries;
pub(super) mod entry_events;
pub(super) mod head;
pub(super) mod idempotency;
pub(super) mod initial_account;
pub(super) mod links;
pub(super) mod moving;
pub(super) mod overview;
pub(super) mod renewals;
pub(super) mod row_version;
pub(super) mod search;
pub(super) mod words;

use futures_util::FutureExt;

use super::labels::{self, Relabel};
use crate::store::engine::codec::{Seal, decode_reals, encode_reals, from_sql, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::jobs::training_names::withdraw_all;
use crate::store::sessions::entries::EntryRow;
use crate::store::sessions::head::Head;
use crate::store::sessions::idempotency::{RequestKey, Used};
use crate::store::sessions::initial_account::InitialAccount;
use crate::store::sessions::row_version::RowVersion;
use crate::store::sessions::words::{Labelled, Worded};
use crate::store::tenants::audit::{Actor, AuditAction, AuditRow};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Quotas, Usage};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError, policies};

/// The outcome of opening a session.
#[derive(Debug, Clone, PartialEq)]
pub enum CreateSession {
    Created,
    /// The tenant used the idempotency key with the same request: the session it opened, as it started.
    Repeated(SessionRow),
    /// The tenant used the idempotency key with another request.
    KeyConflict,
    /// The tenant has no such policy.
    NoPolicy,
    /// The identifier is already used.
    Exists,
}

/// The start of a session; verified against its seal when it is read.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionRow {
    pub session: String,
    pub tenant: Tenant,
    pub policy: String,
    /// The account of an investor at the start; `None` if the session lives a declared problem.
    pub account: Option<InitialAccount>,
    /// The noises known at the start: of an investor the log-returns.
    pub initial_history: Vec<f64>,
    /// The number of periods that its first policy advises.
    pub horizon: usize,
    /// The other facts fixed when it was opened.
    pub plan_json: String,
    /// The number of periods after which it is due for automatic renewal. It only finds sessions, and no seal covers
    /// it.
    pub due: Option<usize>,
    /// The number of assets, or of states and actions, if there are several, 0 for one asset. It only counts bytes, and
    /// no seal covers it.
    pub assets: usize,
    pub created_ms: i64,
}

/// A session as read: its start and every entry.
#[derive(Debug, Clone)]
pub struct SessionFacts {
    pub row: SessionRow,
    /// In the order they were recorded.
    pub entries: Vec<EntryRow>,
    pub seen: RowVersion,
}

impl Store {
    /// Opens a session, sets its labels and records its idempotency key, all or nothing.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if the tenant's quota of sessions or of bytes is used up.
    pub async fn create_session(
        &self,
        new: SessionRow,
        labels: Relabel,
        key: Option<RequestKey>,
    ) -> Result<CreateSession, StoreError> {
        let by = (self.quotas, self.actor.clone());
        self.write("creating a session", move |connection| create(connection, new, labels, key, by).boxed()).await
    }

    /// Reads a session of a tenant.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if the row is not what was written.
    pub async fn session(&self, tenant: &Tenant, session: &str) -> Result<Option<SessionRow>, StoreError> {
        let find = query("SELECT * FROM sessions WHERE session = $1 AND tenant = $2");
        let find = find.bind(session).bind(tenant.as_str());
        self.read("reading a session", find, |rows| rows.first().map(SessionRow::from_row).transpose()).await
    }

    /// Reads a session of a tenant with all its entries.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if a row is not what was written or one is missing.
    pub async fn session_facts(&self, tenant: &Tenant, session: &str) -> Result<Option<SessionFacts>, StoreError> {
        // Read before the rows, so that every later write changes it.
        let change = self.change(session);
        let Some(row) = self.session(tenant, session).await? else { return Ok(None) };
        let Some(entries) = self.entries(session).await? else { return Ok(None) };
        let head = entries.last().map_or_else(|| row.head(), EntryRow::head);
        Ok(Some(SessionFacts { row, entries, seen: RowVersion { head, change } }))
    }

    /// Returns the bytes that the entries of a session take when they are read; 0 if there is no such session. With
    /// several assets an entry also carries their names, twice as often as the plan does.
    pub async fn entry_bytes(&self, session: &str) -> Result<usize, StoreError> {
        let sum = query(
            "SELECT CAST(coalesce(sum(octet_length(content_json) + octet_length(answer_json)
                        + CASE WHEN octet_length(numbers) > 0 THEN 2 * octet_length(plan_json) ELSE 0 END), 0) AS BIGINT) AS bytes
             FROM entries JOIN sessions ON sessions.session = entries.session WHERE entries.session = $1",
        );
        let summed = |rows: &[StoreRow]| rows.first().map_or(Ok(0), |row| row.get("bytes"));
        let bytes: i64 = self.read("measuring entries", sum.bind(session), summed).await?;
        Ok(usize::try_from(bytes).unwrap_or_default())
    }

    /// Returns the newest observations of a session, newest first, as audit rows; none if there is no such session.
    pub(super) async fn observed(&self, session: &str, limit: usize) -> Result<Vec<AuditRow>, StoreError> {
        let newest = query(
            "SELECT entries.*, sessions.tenant FROM entries JOIN sessions ON sessions.session = entries.session
             WHERE entries.session = $1 AND kind = 'observation' ORDER BY entry DESC LIMIT $2",
        );
        let decode = |rows: &[StoreRow]| rows.iter().map(EntryRow::audit_row).collect();
        self.list("reading the audit", newest.bind(session).bind(to_sql(limit)), decode).await
    }

    /// Deletes a session of a tenant and its entries. Returns false if there was none.
    pub async fn delete_session(&self, tenant: &Tenant, session: &str) -> Result<bool, StoreError> {
        let (tenant, name, actor) = (tenant.clone(), session.to_owned(), self.actor.clone());
        self.write_to(session, "deleting a session", move |connection| delete(connection, tenant, name, actor).boxed())
            .await
    }

    pub async fn count_sessions(&self) -> Result<u64, StoreError> {
        let count = query("SELECT CAST(coalesce(sum(sessions), 0) AS BIGINT) AS sessions FROM usage");
        let counted = |rows: &[StoreRow]| rows.first().map_or(Ok(0), |row| row.get("sessions"));
        self.probe("counting sessions", count, counted).await.map(i64::unsigned_abs)
    }
}

fn history_seal(history: &[f64]) -> Vec<u8> {
    Seal::of("history").bytes(&encode_reals(history)).finish()
}

async fn create(
    mut connection: StoreConnection<'_>,
    row: SessionRow,
    labels: Relabel,
    key: Option<RequestKey>,
    (quotas, actor): (Quotas, Actor),
) -> Result<CreateSession, Failure> {
    let connection = &mut connection;
    if let Some(key) = &key
        && let Some(earlier) = repeated(connection, &row.tenant, key).await?
    {
        return Ok(earlier);
    }
    let sequence = match insert(connection, &row).await? {
        Ok(sequence) => sequence,
        Err(refused) => return Ok(refused),
    };
    if let Some(key) = &key
        && !idempotency::take(connection, &row.tenant, key, &row.session).await?
    {
        connection.execute(query("DELETE FROM sessions WHERE session = $1").bind(row.session)).await?;
        let earlier = repeated(connection, &row.tenant, key).await?;
        return earlier.ok_or_else(|| Failure::Corrupt(format!("the idempotency key {}", key.key)));
    }
    let of = Worded { tenant: &row.tenant, kind: Labelled::Session, sequence };
    words::add(connection, of, [words::identifying(&row.session).as_str()]).await?;
    let start_bytes = quotas::length(&encode_reals(&row.initial_history)) + quotas::length(row.plan_json.as_bytes());
    let mut usage = Usage::of_session(start_bytes, to_sql(row.horizon), to_sql(row.assets));
    if !labels.is_empty() {
        usage = usage.and(labels::put(connection, of, &row.session, &labels).await?.1);
    }
    quotas::take(connection, &row.tenant, usage, quotas).await?;
    let outcome = format!("opened under policy {}", row.policy);
    audit_chain::record(connection, (quotas, &actor), &row.tenant, AuditAction::OpenSession, &row.session, &outcome)
        .await?;
    Ok(CreateSession::Created)
}

/// Returns the answer for an idempotency key that was used before; `None` for a new key.
async fn repeated(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    key: &RequestKey,
) -> Result<Option<CreateSession>, Failure> {
    let session = match idempotency::used(connection, tenant, key).await? {
        None => return Ok(None),
        Some(Used::ByAnother) => return Ok(Some(CreateSession::KeyConflict)),
        Some(Used::BySame { session }) => session,
    };
    let find = query("SELECT * FROM sessions WHERE session = $1").bind(session.unwrap_or_default());
    match connection.row(find).await? {
        Some(row) => Ok(Some(CreateSession::Repeated(SessionRow::from_row(&row)?))),
        None => Err(Failure::Corrupt(format!("the idempotency key {}", key.key))),
    }
}

/// Inserts a session and returns its sequence, or the outcome if it cannot be inserted. The policy stays locked until
/// then, so that it cannot be deleted in between.
async fn insert(connection: &mut StoreConnection<'_>, row: &SessionRow) -> Result<Result<i64, CreateSession>, Failure> {
    if !policies::lock(connection, &row.policy).await?
        || !policies::is_owned(connection, &row.tenant, &row.policy).await?
    {
        return Ok(Err(CreateSession::NoPolicy));
    }
    let insert = query(
        "INSERT INTO sessions (session, policy, initial_wealth, initial_holding, initial_history, horizon, room, created_ms,
                               seal, tenant, plan_json, due, history_seal, assets)
         VALUES ($1, $2, $3, $4, $5, $6, $6, $7, $8, $9, $10, $11, $12, $13) ON CONFLICT (session) DO NOTHING
         RETURNING sequence",
    );
    let insert = insert
        .bind(row.session.as_str())
        .bind(row.policy.as_str())
        .bind(row.account.map(|account| account.wealth))
        .bind(row.account.map(|account| account.holding))
        .bind(encode_reals(&row.initial_history))
        .bind(to_sql(row.horizon))
        .bind(row.created_ms)
        .bind(row.seal().finish())
        .bind(row.tenant.as_str())
        .bind(row.plan_json.as_str())
        .bind(row.due.map(to_sql))
        .bind(history_seal(&row.initial_history))
        .bind(to_sql(row.assets));
    let inserted = connection.row(insert).await?.map(|row| row.get("sequence")).transpose()?;
    Ok(inserted.ok_or(CreateSession::Exists))
}

/// Deletes a session. The audit records how many entries were deleted with it.
async fn delete(
    mut connection: StoreConnection<'_>,
    tenant: Tenant,
    session: String,
    actor: Actor,
) -> Result<bool, Failure> {
    let connection = &mut connection;
    withdraw_all(connection, &tenant, &session).await?;
    let count = query("SELECT count(*) AS entries FROM entries WHERE session = $1").bind(session.as_str());
    let entries: i64 = connection.row(count).await?.map_or(Ok(0), |row| row.get("entries"))?;
    let delete = query(
        "DELETE FROM sessions WHERE session = $1 AND tenant = $2
         RETURNING CAST(octet_length(initial_history) + octet_length(plan_json) AS BIGINT) AS start_bytes, room, assets, sequence",
    );
    let deleted = connection.row(delete.bind(session.as_str()).bind(tenant.as_str())).await?;
    let Some(row) = deleted else { return Ok(false) };
    let usage = Usage::of_session(row.get("start_bytes")?, row.get("room")?, row.get("assets")?);
    let of = Worded { tenant: &tenant, kind: Labelled::Session, sequence: row.get("sequence")? };
    let usage = usage.and(labels::remove(connection, of, &session).await?);
    quotas::change(connection, &tenant, usage.negated()).await?;
    let outcome = format!("deleted, with {entries} entries");
    audit_chain::record(connection, (Quotas::NONE, &actor), &tenant, AuditAction::DeleteSession, &session, &outcome)
        .await?;
    Ok(true)
}

impl SessionRow {
    /// Returns the head of the session before its first entry.
    pub fn head(&self) -> Head {
        Head { entries: 0, seal: self.seal().finish() }
    }

    /// Returns the version of the session before its first entry; only a read shows if it is still current.
    pub fn as_opened(&self) -> RowVersion {
        RowVersion { head: self.head(), change: None }
    }

    fn seal(&self) -> Seal {
        self.seal_with(&history_seal(&self.initial_history))
    }

    /// Computes the seal over the start; of the history it needs only the seal.
    pub(super) fn seal_with(&self, history_seal: &[u8]) -> Seal {
        Seal::of("session")
            .text(&self.session)
            .text(self.tenant.as_str())
            .text(&self.policy)
            .bytes(&self.account.map_or_else(Vec::new, |account| encode_reals(&[account.wealth, account.holding])))
            .bytes(history_seal)
            .integer(to_sql(self.horizon))
            .text(&self.plan_json)
            .integer(self.created_ms)
    }

    /// Reads and verifies the start of a session in a list, without its history.
    pub(super) fn start_of(row: &StoreRow) -> Result<Self, Failure> {
        let start = SessionRow {
            session: row.get("session")?,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            policy: row.get("first_policy")?,
            account: InitialAccount::from_row(row)?,
            initial_history: Vec::new(),
            horizon: from_sql(row.get("first_horizon")?)?,
            plan_json: row.get("plan_json")?,
            assets: 0,
            due: None,
            created_ms: row.get("created_ms")?,
        };
        let seal = start.seal_with(&row.get::<Vec<u8>>("history_seal")?);
        seal.verify(&row.get::<Vec<u8>>("seal")?, || format!("the start of session {}", start.session))?;
        Ok(start)
    }

    pub(super) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let session: String = row.get("session")?;
        let what = || format!("the start of session {session}");
        let history = decode_reals(&row.get::<Vec<u8>>("initial_history")?);
        let read = SessionRow {
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            policy: row.get("policy")?,
            account: InitialAccount::from_row(row)?,
            initial_history: history.ok_or_else(|| Failure::Corrupt(what()))?,
            horizon: from_sql(row.get("horizon")?)?,
            plan_json: row.get("plan_json")?,
            due: row.get::<Option<i64>>("due")?.map(from_sql).transpose()?,
            assets: from_sql(row.get("assets")?)?,
            created_ms: row.get("created_ms")?,
            session: session.clone(),
        };
        read.seal().verify(&row.get::<Vec<u8>>("seal")?, what)?;
        if row.get::<Vec<u8>>("history_seal")? != history_seal(&read.initial_history) {
            return Err(Failure::Corrupt(what()));
        }
        Ok(read)
    }
}
