//! The quotas of a tenant: jobs queued, sessions, bytes.
//!
//! The usage of a tenant is a row of totals. A transaction changes the totals after the counted rows, near its end, so
//! another writer waits for little more than its commit. Queued jobs are counted in their own table, up to the quota;
//! jobs made for sessions have a bound of their own (`crate::store::jobs::session_trainings`).
//!
//! The bytes counted are those of requests, reports, policies, histories, plans and labels, and [`ROW_BYTES`] for each
//! job, policy and session. Opening a session reserves the bytes of all its observations, each at the longest size. So
//! no quota ever rejects a reported return, nor the result of a worker. Checkpoints are not counted, because they are
//! deleted when their job ends.
//!
//! Checked by: `tests/service/quotas.rs`, `tests/service/store_model.rs`.

use crate::store::engine::codec::to_sql;
use crate::store::engine::error::{Failure, OverQuota, Quota};
use crate::store::engine::query::{StoreConnection, query};
use crate::store::jobs::state::JobState;
use crate::store::sessions::idempotency::FOR_SESSIONS;
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// Bytes of a row of jobs, policies or sessions with its index entries, beside the parts counted by length.
pub(in crate::store) const ROW_BYTES: i64 = 1024;
/// Bytes of one entry of a session with its report, its answer, its seal and its index entry. An entry takes some 900
/// bytes, and up to 1,400 if everything of a period is reported (`docs/capacity.md`).
pub(in crate::store) const ENTRY_BYTES: i64 = 1536;
/// The part of these bytes that the seal, the numbers and the index entry take in every entry.
pub(in crate::store) const SEALED_BYTES: i64 = 160;
/// Additional bytes of an entry for each of several assets: eleven numbers, three of them reported and eight answered.
pub(in crate::store) const ASSET_BYTES: i64 = 11 * 8;

/// The quotas of every tenant; 0 means no limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quotas {
    pub queued_jobs: u32,
    pub sessions: u32,
    pub bytes: u64,
    /// The number of changes by one key that the audit keeps.
    pub audit_entries: u32,
}

impl Quotas {
    pub(in crate::store) const NONE: Quotas = Quotas { queued_jobs: 0, sessions: 0, bytes: 0, audit_entries: 0 };
}

impl Default for Quotas {
    /// Returns quotas far above what a tenant needs: they stop runaway loops, not users.
    fn default() -> Self {
        Quotas { queued_jobs: 1_000, sessions: 1_000_000, bytes: 100 << 30, audit_entries: 5_000_000 }
    }
}

/// The usage of a tenant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Usage {
    pub sessions: i64,
    pub bytes: i64,
}

impl Usage {
    pub(in crate::store) fn of_bytes(bytes: i64) -> Self {
        Usage { sessions: 0, bytes }
    }

    /// Returns the usage of a session with `room` entries of `assets` assets.
    pub(in crate::store) fn of_session(start_bytes: i64, room: i64, assets: i64) -> Self {
        let entries = Usage::of_entries(room, assets).bytes;
        Usage { sessions: 1, bytes: ROW_BYTES.saturating_add(start_bytes).saturating_add(entries) }
    }

    /// Returns the usage of `room` entries of `assets` assets.
    pub(in crate::store) fn of_entries(room: i64, assets: i64) -> Self {
        Usage::of_bytes(room.saturating_mul(entry_bytes(assets)))
    }

    /// Returns the sum of both.
    pub(in crate::store) fn and(self, other: Usage) -> Self {
        Usage { sessions: self.sessions + other.sessions, bytes: self.bytes.saturating_add(other.bytes) }
    }

    /// Returns the change of the totals that frees this usage.
    pub(in crate::store) fn negated(self) -> Self {
        Usage { sessions: -self.sessions, bytes: -self.bytes }
    }
}

/// Returns the bytes that an entry counts as; `assets` is 0 for a session with a single asset.
pub(in crate::store) fn entry_bytes(assets: i64) -> i64 {
    ENTRY_BYTES.saturating_add(assets.saturating_mul(ASSET_BYTES))
}

impl Store {
    /// Returns the usage of a tenant.
    pub async fn usage(&self, tenant: &Tenant) -> Result<Usage, StoreError> {
        let totals = query("SELECT sessions, bytes FROM usage WHERE tenant = $1").bind(tenant.as_str());
        self.list("reading the usage of a tenant", totals, |rows| {
            let Some(row) = rows.first() else { return Ok(Usage::default()) };
            Ok(Usage { sessions: row.get("sessions")?, bytes: row.get("bytes")? })
        })
        .await
    }
}

/// Checks the quota of queued jobs before a caller's job is queued.
///
/// # Errors
/// Fails if the tenant's callers have used up the quota of queued jobs.
pub(in crate::store) async fn admit_job(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    quotas: Quotas,
) -> Result<(), Failure> {
    if quotas.queued_jobs == 0 {
        return Ok(());
    }
    let queued = queued_by_callers(connection, tenant, quotas.queued_jobs).await?;
    within(Quota::QueuedJobs, queued, 1, quotas.queued_jobs.into())
}

/// Counts the queued jobs of a tenant that its callers queued: all but those made for sessions, up to `limit`.
async fn queued_by_callers(connection: &mut StoreConnection<'_>, tenant: &Tenant, limit: u32) -> Result<i64, Failure> {
    let queued = query(
        "SELECT count(*) AS queued FROM (SELECT 1 AS one FROM jobs WHERE tenant = $1 AND state = $2
             AND NOT EXISTS (SELECT 1 FROM idempotency_keys WHERE idempotency_keys.job = jobs.job
                             AND substr(idempotency_key, 1, 7) = $3) LIMIT $4) AS waiting",
    );
    let queued = queued.bind(tenant.as_str()).bind(JobState::Queued.as_str()).bind(FOR_SESSIONS);
    connection.row(queued.bind(i64::from(limit))).await?.map_or(Ok(0), |row| row.get("queued"))
}

/// Adds to the usage of a tenant.
///
/// # Errors
/// Fails if the usage would exceed a quota; the transaction must then be rolled back.
pub(in crate::store) async fn take(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    more: Usage,
    quotas: Quotas,
) -> Result<(), Failure> {
    let kept = change(connection, tenant, more).await?;
    within(Quota::Sessions, kept.sessions - more.sessions, more.sessions, quotas.sessions.into())?;
    within(Quota::Bytes, kept.bytes - more.bytes, more.bytes, quotas.bytes)
}

/// Changes the usage of a tenant without checking the quotas, and returns the new usage.
pub(in crate::store) async fn change(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    by: Usage,
) -> Result<Usage, Failure> {
    let change = query(
        "INSERT INTO usage (tenant, sessions, bytes) VALUES ($1, $2, $3)
         ON CONFLICT (tenant) DO UPDATE SET sessions = usage.sessions + excluded.sessions,
                                            bytes = usage.bytes + excluded.bytes
         RETURNING sessions, bytes",
    );
    let changed = connection.row(change.bind(tenant.as_str()).bind(by.sessions).bind(by.bytes)).await?;
    let changed = changed.ok_or_else(|| Failure::Corrupt(format!("the usage of the tenant {tenant}")))?;
    Ok(Usage { sessions: changed.get("sessions")?, bytes: changed.get("bytes")? })
}

pub(in crate::store) fn within(quota: Quota, kept: i64, wanted: i64, limit: u64) -> Result<(), Failure> {
    let (kept, wanted) = (u64::try_from(kept).unwrap_or_default(), u64::try_from(wanted).unwrap_or_default());
    if limit == 0 || wanted == 0 || kept.saturating_add(wanted) <= limit {
        return Ok(());
    }
    Err(Failure::OverQuota(OverQuota { quota, kept, wanted, limit }))
}

/// Returns the number of bytes as the totals count them.
pub(in crate::store) fn length(bytes: &[u8]) -> i64 {
    to_sql(bytes.len())
}
