//! The names of trainings: the sessions that requested a job, and the specification it trains.
//!
//! They are idempotency keys that no caller can send, because no header contains a line break. They are deleted with
//! their job.

use crate::control::policy::content_hash;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, query};
use crate::store::jobs::job::{JobKind, JobRow, NewJob};
use crate::store::jobs::state::JobState;
use crate::store::sessions::idempotency::FOR_SESSIONS;
use crate::store::tenants::tenant::Tenant;

/// Prefix of the key of a session's request.
pub(in crate::store) const OF_SESSION: &str = "renewal\n";
/// Prefix of the key of a training that a caller queued.
const OF_CALLER: &str = "trained\n";

/// A session's request for the policy of its next renewal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrainingRequest {
    pub session: String,
    /// The number of the renewal.
    pub renewal: usize,
    /// The number of earlier requests for that renewal, whose jobs failed.
    pub attempt: usize,
}

impl TrainingRequest {
    /// Returns the idempotency key that names its job.
    pub fn key(&self) -> String {
        let TrainingRequest { session, renewal, attempt } = self;
        format!("{OF_SESSION}{session}\n{renewal}\n{attempt}")
    }
}

/// Returns the number of the next renewal of a session.
pub(super) async fn next_renewal(connection: &mut StoreConnection<'_>, session: &str) -> Result<usize, Failure> {
    let made = query("SELECT coalesce(max(number), 0) AS made FROM renewals WHERE session = $1").bind(session);
    let made: i64 = connection.row(made).await?.map_or(Ok(0), |row| row.get("made"))?;
    Ok(usize::try_from(made).unwrap_or_default() + 1)
}

/// Finds the job that trains a specification, or that has trained it if its policy still exists. Prefers the latter.
pub(super) async fn of_specification(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    specification: &str,
) -> Result<Option<JobRow>, Failure> {
    let find = query(
        "SELECT jobs.* FROM idempotency_keys JOIN jobs ON jobs.job = idempotency_keys.job
         WHERE idempotency_keys.tenant = $1 AND idempotency_key IN ($2, $3)
             AND (jobs.state IN ('queued', 'running') AND NOT jobs.cancel_requested
                  OR jobs.state = 'succeeded' AND EXISTS (SELECT 1 FROM policy_owners
                      WHERE policy_owners.policy = jobs.policy AND policy_owners.tenant = $1))
         ORDER BY CASE jobs.state WHEN 'succeeded' THEN 0 WHEN 'running' THEN 1 ELSE 2 END LIMIT 1",
    );
    let find = find.bind(tenant.as_str()).bind(format!("{FOR_SESSIONS}{specification}"));
    let found = connection.row(find.bind(format!("{OF_CALLER}{specification}"))).await?;
    found.as_ref().map(JobRow::from_row).transpose()
}

pub(super) async fn queued_for_sessions(connection: &mut StoreConnection<'_>, tenant: &Tenant) -> Result<i64, Failure> {
    let queued = query(
        "SELECT count(*) AS queued FROM jobs WHERE tenant = $1 AND state = $2
             AND EXISTS (SELECT 1 FROM idempotency_keys WHERE idempotency_keys.job = jobs.job
                         AND substr(idempotency_key, 1, 7) = $3)",
    );
    let queued = queued.bind(tenant.as_str()).bind(JobState::Queued.as_str()).bind(FOR_SESSIONS);
    connection.row(queued).await?.map_or(Ok(0), |row| row.get("queued"))
}

/// Names a training that a caller queued by its specification.
pub(super) async fn name_training(connection: &mut StoreConnection<'_>, new: &NewJob) -> Result<(), Failure> {
    if new.kind != JobKind::Train {
        return Ok(());
    }
    let specification = content_hash(new.request_json.as_bytes());
    name(connection, &new.tenant, &new.job, &format!("{OF_CALLER}{specification}")).await
}

/// Gives a job a name, which no other job has from then on.
pub(in crate::store) async fn name(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    job: &str,
    key: &str,
) -> Result<(), Failure> {
    let name = query(
        "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, job) VALUES ($1, $2, '', $3)
         ON CONFLICT (tenant, idempotency_key) DO UPDATE SET job = excluded.job",
    );
    connection.execute(name.bind(tenant.as_str()).bind(key).bind(job)).await.map(drop)
}

/// Withdraws the requests of a session for its next renewal, because it is deleted or about to be renewed.
pub(in crate::store) async fn withdraw(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    session: &str,
    renewal: usize,
) -> Result<(), Failure> {
    for attempt in 0.. {
        let request = TrainingRequest { session: session.to_owned(), renewal, attempt };
        let withdraw = query("DELETE FROM idempotency_keys WHERE tenant = $1 AND idempotency_key = $2");
        if connection.execute(withdraw.bind(tenant.as_str()).bind(request.key())).await? == 0 {
            break;
        }
    }
    Ok(())
}

/// Withdraws the requests of a session that is about to be deleted, and locks it against a renewal in between.
pub(in crate::store) async fn withdraw_all(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    session: &str,
) -> Result<(), Failure> {
    let session_row = query("SELECT session FROM sessions WHERE session = $1 AND tenant = $2");
    connection.lock(session_row.bind(session).bind(tenant.as_str()).for_update()).await?;
    let renewal = next_renewal(connection, session).await?;
    withdraw(connection, tenant, session, renewal).await
}
