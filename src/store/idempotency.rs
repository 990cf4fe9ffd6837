//! Idempotency keys of sessions: the same key and request again find the session that the first one opened.
//!
//! A key is its tenant's, over jobs and sessions alike, and lives as long as what it made.

use super::error::Failure;
use super::query::{Connection, query};
use super::sessions::{CreateSession, SessionRow};
use super::tenant::Tenant;

/// What tells a repeated request from a new one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestKey {
    /// As the user chose it.
    pub key: String,
    /// Hash of the request as the user sent it: tells a repeat from another request under the same key.
    pub request_hash: String,
}

/// What a key used before answers; `None` for a new key.
pub(super) async fn repeated(
    connection: &mut Connection<'_>,
    tenant: &Tenant,
    key: &RequestKey,
) -> Result<Option<CreateSession>, Failure> {
    let used = query("SELECT request_hash, session FROM idempotency_keys WHERE tenant = $1 AND idempotency_key = $2");
    let used = used.bind(tenant.as_str()).bind(key.key.as_str());
    let Some(used) = connection.row(used.for_share()).await? else { return Ok(None) };
    if used.get::<String>("request_hash")? != key.request_hash {
        return Ok(Some(CreateSession::KeyConflict));
    }
    let session: Option<String> = used.get("session")?;
    let find = query("SELECT * FROM sessions WHERE session = $1").bind(session.unwrap_or_default());
    match connection.row(find).await? {
        Some(row) => Ok(Some(CreateSession::Repeated(SessionRow::from_row(&row)?))),
        None => Err(Failure::Corrupt(format!("the idempotency key {}", key.key))),
    }
}

/// Takes the key for a session. False where somebody else took it in the meantime.
pub(super) async fn take(
    connection: &mut Connection<'_>,
    tenant: &Tenant,
    key: &RequestKey,
    session: &str,
) -> Result<bool, Failure> {
    let take = query(
        "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, session) VALUES ($1, $2, $3, $4)
         ON CONFLICT (tenant, idempotency_key) DO NOTHING",
    );
    let take = take.bind(tenant.as_str()).bind(key.key.as_str()).bind(key.request_hash.as_str()).bind(session);
    Ok(connection.execute(take).await? > 0)
}
