//! Policies: immutable, named by the hash of their bytes. Several tenants may have the same policy: the bytes are
//! stored once, and each tenant sees, dates and deletes its own entry. The bytes are deleted with their last owner.

use futures_util::FutureExt;

use super::labels::{self, Labels};
use crate::control::policy::{content_hash, periods_per_year};
use crate::store::engine::codec::to_sql;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{Query, StoreConnection, StoreRow, query};
use crate::store::sessions::words::{self, Labelled, Worded};
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Quotas, ROW_BYTES, Usage};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// A policy as stored, its bytes verified against its name.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicyRow {
    pub policy: String,
    pub created_ms: i64,
    pub json: Vec<u8>,
}

/// The time when a tenant obtained a policy, and the length of its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stored {
    pub created_ms: i64,
    pub bytes: usize,
}

/// A policy without its bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicySummary {
    /// Order of creation; the cursor of [`Store::policies`].
    pub sequence: i64,
    pub policy: String,
    pub created_ms: i64,
    /// Length of its portable form.
    pub bytes: u64,
    pub labels: Labels,
}

/// The outcome of a request to delete a policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeletePolicy {
    Deleted,
    Absent,
    /// Sessions use it; it stays.
    InUse {
        sessions: u64,
    },
}

impl Store {
    /// Stores a policy of a tenant under its content hash. Returns false if the tenant already had it.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if `id` is not the hash of `json`, [`StoreError::OverQuota`] if the tenant's quota of
    /// bytes is used up.
    pub async fn insert_policy(
        &self,
        tenant: &Tenant,
        id: &str,
        json: &[u8],
        created_ms: i64,
    ) -> Result<bool, StoreError> {
        let doing = "inserting a policy";
        verify(id, json).map_err(|failure| failure.during(doing))?;
        // Computed before the write, because other writers wait for it.
        let (tenant, id, year, json) = (tenant.clone(), id.to_owned(), periods_per_year(json), json.to_vec());
        let (quotas, actor) = (self.quotas, self.actor.clone());
        self.write(doing, move |mut connection| {
            async move {
                let is_new = insert(&mut connection, &tenant, &id, (json, year), created_ms, quotas).await?;
                if is_new {
                    audit_chain::record(
                        &mut connection,
                        (quotas, &actor),
                        &tenant,
                        AuditAction::ImportPolicy,
                        &id,
                        "stored",
                    )
                    .await?;
                }
                Ok(is_new)
            }
            .boxed()
        })
        .await
    }

    /// Reads a policy of a tenant, for advice.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if the bytes no longer hash to their name.
    pub async fn policy(&self, tenant: &Tenant, id: &str) -> Result<Option<PolicyRow>, StoreError> {
        self.read("reading a policy", owned(OWNED, tenant, id), |rows| PolicyRow::verified(rows, id)).await
    }

    /// Reads a policy like [`Store::policy`], over the connections for lists.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if the bytes no longer hash to their name.
    pub async fn policy_to_send(&self, tenant: &Tenant, id: &str) -> Result<Option<PolicyRow>, StoreError> {
        self.list("reading a policy to send", owned(OWNED, tenant, id), |rows| PolicyRow::verified(rows, id)).await
    }

    /// Returns the date and size of a policy without reading its bytes.
    pub async fn policy_stored(&self, tenant: &Tenant, id: &str) -> Result<Option<Stored>, StoreError> {
        let decode = |row: &StoreRow| Ok(Stored { created_ms: row.get("created_ms")?, bytes: row.length("bytes")? });
        self.list("measuring a policy", owned(MEASURED, tenant, id), |rows| rows.first().map(decode).transpose()).await
    }

    /// Returns at most `limit` policies of a tenant, newest first; `after` is the `sequence` of the last row of the
    /// page before.
    pub async fn policies(
        &self,
        tenant: &Tenant,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<PolicySummary>, StoreError> {
        let page = query(
            "SELECT policy_owners.sequence, policies.policy, policy_owners.created_ms,
                    CAST(octet_length(json) AS BIGINT) AS bytes, labels.name, labels.notes, labels.tags
             FROM policy_owners JOIN policies ON policies.policy = policy_owners.policy
             LEFT JOIN labels ON labels.tenant = policy_owners.tenant AND labels.object = policies.policy
             WHERE policy_owners.tenant = $1 AND policy_owners.sequence < $2 ORDER BY policy_owners.sequence DESC LIMIT $3",
        );
        let page = page.bind(tenant.as_str()).bind(after.unwrap_or(i64::MAX)).bind(to_sql(limit));
        self.list("listing policies", page, |rows| rows.iter().map(PolicySummary::from_row).collect()).await
    }

    pub async fn delete_policy(&self, tenant: &Tenant, id: &str) -> Result<DeletePolicy, StoreError> {
        let (tenant, id, actor) = (tenant.clone(), id.to_owned(), self.actor.clone());
        self.write("deleting a policy", move |connection| delete(connection, tenant, id, actor).boxed()).await
    }
}

const OWNED: &str = "SELECT policies.policy, policy_owners.created_ms, json
     FROM policies JOIN policy_owners ON policy_owners.policy = policies.policy WHERE policies.policy = $1 AND tenant = $2";
const MEASURED: &str = "SELECT policy_owners.created_ms, CAST(octet_length(json) AS BIGINT) AS bytes
     FROM policies JOIN policy_owners ON policy_owners.policy = policies.policy WHERE policies.policy = $1 AND tenant = $2";

fn owned(statement: &'static str, tenant: &Tenant, id: &str) -> Query {
    query(statement).bind(id).bind(tenant.as_str())
}

pub(super) fn verify(id: &str, json: &[u8]) -> Result<(), Failure> {
    if content_hash(json) == id { Ok(()) } else { Err(Failure::Corrupt(format!("policy {id}"))) }
}

pub(super) async fn insert(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    id: &str,
    (json, periods_per_year): (Vec<u8>, Option<f64>),
    created_ms: i64,
    quotas: Quotas,
) -> Result<bool, Failure> {
    let bytes = Usage::of_bytes(ROW_BYTES + quotas::length(&json));
    let insert = |json: Vec<u8>| {
        let insert = query(
            "INSERT INTO policies (policy, created_ms, periods_per_year, json) VALUES ($1, $2, $3, $4)
             ON CONFLICT (policy) DO NOTHING",
        );
        insert.bind(id).bind(created_ms).bind(periods_per_year).bind(json)
    };
    connection.execute(insert(json.clone())).await?;
    let kept = query("SELECT sequence FROM policies WHERE policy = $1").bind(id);
    if connection.row(kept.for_share()).await?.is_none() {
        // Its last owner deleted it in the meantime.
        connection.execute(insert(json)).await?;
    }
    let own = query(
        "INSERT INTO policy_owners (tenant, policy, created_ms) VALUES ($1, $2, $3)
         ON CONFLICT (policy, tenant) DO NOTHING RETURNING sequence",
    );
    let new = connection.row(own.bind(tenant.as_str()).bind(id).bind(created_ms)).await?;
    if let Some(row) = &new {
        let of = Worded { tenant, kind: Labelled::Policy, sequence: row.get("sequence")? };
        words::add(connection, of, [words::identifying(id).as_str()]).await?;
        quotas::take(connection, tenant, bytes, quotas).await?;
    }
    Ok(new.is_some())
}

/// Locks a policy against deletion until this transaction ends; returns whether it exists.
pub(super) async fn lock(connection: &mut StoreConnection<'_>, id: &str) -> Result<bool, Failure> {
    let policy = query("SELECT sequence FROM policies WHERE policy = $1").bind(id);
    Ok(connection.row(policy.for_share()).await?.is_some())
}

pub(super) async fn is_owned(connection: &mut StoreConnection<'_>, tenant: &Tenant, id: &str) -> Result<bool, Failure> {
    let owner = query("SELECT sequence FROM policy_owners WHERE policy = $1 AND tenant = $2");
    Ok(connection.row(owner.bind(id).bind(tenant.as_str())).await?.is_some())
}

/// Deletes a policy of a tenant. It stays locked while its sessions are counted, so that none can be opened in between.
async fn delete(
    mut connection: StoreConnection<'_>,
    tenant: Tenant,
    id: String,
    actor: Actor,
) -> Result<DeletePolicy, Failure> {
    let connection = &mut connection;
    let lock = query("SELECT CAST(octet_length(json) AS BIGINT) AS bytes FROM policies WHERE policy = $1");
    let Some(row) = connection.row(lock.bind(id.as_str()).for_update()).await? else {
        return Ok(DeletePolicy::Absent);
    };
    if !is_owned(connection, &tenant, &id).await? {
        return Ok(DeletePolicy::Absent);
    }
    let count = query(
        "SELECT count(*) AS sessions FROM sessions
         WHERE tenant = $2 AND session IN (SELECT session FROM sessions WHERE policy = $1
                                           UNION SELECT session FROM renewals WHERE policy = $1)",
    );
    let count = count.bind(id.as_str()).bind(tenant.as_str());
    let sessions: i64 = connection.row(count).await?.map_or(Ok(0), |row| row.get("sessions"))?;
    if sessions > 0 {
        return Ok(DeletePolicy::InUse { sessions: sessions.unsigned_abs() });
    }
    let disown = query("DELETE FROM policy_owners WHERE policy = $1 AND tenant = $2 RETURNING sequence");
    let Some(disowned) = connection.row(disown.bind(id.as_str()).bind(tenant.as_str())).await? else {
        return Ok(DeletePolicy::Absent);
    };
    let unowned = query(
        "DELETE FROM policies WHERE policy = $1
         AND NOT EXISTS (SELECT 1 FROM policy_owners WHERE policy_owners.policy = policies.policy)",
    );
    connection.execute(unowned.bind(id.as_str())).await?;
    let bytes = Usage::of_bytes(ROW_BYTES + row.get::<i64>("bytes")?);
    let of = Worded { tenant: &tenant, kind: Labelled::Policy, sequence: disowned.get("sequence")? };
    let bytes = bytes.and(labels::remove(connection, of, &id).await?);
    quotas::change(connection, &tenant, bytes.negated()).await?;
    audit_chain::record(connection, (Quotas::NONE, &actor), &tenant, AuditAction::DeletePolicy, &id, "deleted").await?;
    Ok(DeletePolicy::Deleted)
}

impl PolicyRow {
    fn verified(rows: &[StoreRow], id: &str) -> Result<Option<Self>, Failure> {
        let Some(row) = rows.first() else { return Ok(None) };
        let json: Vec<u8> = row.get("json")?;
        verify(id, &json)?;
        Ok(Some(PolicyRow { policy: row.get("policy")?, created_ms: row.get("created_ms")?, json }))
    }
}

impl PolicySummary {
    fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        Ok(PolicySummary {
            sequence: row.get("sequence")?,
            policy: row.get("policy")?,
            created_ms: row.get("created_ms")?,
            bytes: row.length("bytes")? as u64,
            labels: Labels::from_row(row)?,
        })
    }
}
