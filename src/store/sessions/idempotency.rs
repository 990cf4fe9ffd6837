//! Idempotency keys of sessions: the same key and request again find the session that the first request opened.
//!
//! A key belongs to its tenant, over jobs and sessions alike, and lives as long as what it made.

use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, query};
use crate::store::tenants::tenant::Tenant;

/// Prefix of the idempotency key of a training that was made for sessions. No caller can send such a key, because no
/// header contains a line break.
pub(in crate::store) const FOR_SESSIONS: &str = "shared\n";

/// The parts that distinguish a repeated request from a new one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestKey {
    /// The idempotency key as the user chose it.
    pub key: String,
    /// Hash of the request as the user sent it; distinguishes a repeat from another request under the same key.
    pub request_hash: String,
}

/// The earlier use of a key.
pub(in crate::store) enum Used {
    /// It was used for an identical request, which opened this session.
    BySame { session: Option<String> },
    /// It was used for another request.
    ByAnother,
}

/// Returns the earlier use of the key; `None` for a new key.
pub(in crate::store) async fn used(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    key: &RequestKey,
) -> Result<Option<Used>, Failure> {
    let used = query("SELECT request_hash, session FROM idempotency_keys WHERE tenant = $1 AND idempotency_key = $2");
    let used = used.bind(tenant.as_str()).bind(key.key.as_str());
    let Some(used) = connection.row(used.for_share()).await? else { return Ok(None) };
    let is_same = used.get::<String>("request_hash")? == key.request_hash;
    Ok(Some(if is_same { Used::BySame { session: used.get("session")? } } else { Used::ByAnother }))
}

/// Takes the key for a session. Returns false if another transaction took it in the meantime.
pub(in crate::store) async fn take(
    connection: &mut StoreConnection<'_>,
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
