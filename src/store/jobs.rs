//! Jobs as users see them: created once, listed, cancelled, and deleted after they have ended.
//!
//! Its modules hold the life of a job, its leases, its turns and names, and the deletion of ended ones.

pub(super) mod job;
pub(super) mod leases;
pub(super) mod retention;
pub(super) mod session_trainings;
pub(super) mod state;
pub(super) mod training_names;
pub(super) mod turns;

use futures_util::FutureExt;

use super::labels::Relabel;
use crate::store::engine::codec::to_sql;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::jobs::job::{CreateJob, JobCounts, JobRow, NewJob, OldestJobs};
use crate::store::jobs::state::{JobEvent, JobState};
use crate::store::subscriptions::events;
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Quotas, ROW_BYTES, Usage};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

impl Store {
    /// Queues a job and records its idempotency key, both or neither.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if the tenant has used up its quota of queued jobs or of bytes.
    pub async fn create_job(&self, new: NewJob) -> Result<CreateJob, StoreError> {
        let (quotas, actor) = (self.quotas, self.actor.clone());
        self.write("creating a job", move |connection| create(connection, new, quotas, actor).boxed()).await
    }

    pub async fn job(&self, job: &str) -> Result<Option<JobRow>, StoreError> {
        let find = query("SELECT * FROM jobs WHERE job = $1").bind(job);
        self.list("reading a job", find, |rows| rows.first().map(JobRow::from_row).transpose()).await
    }

    /// Returns the job that a tenant's idempotency key made.
    pub async fn job_by_key(&self, tenant: &Tenant, key: &str) -> Result<Option<JobRow>, StoreError> {
        let find = query(
            "SELECT jobs.* FROM idempotency_keys JOIN jobs ON jobs.job = idempotency_keys.job
             WHERE idempotency_keys.tenant = $1 AND idempotency_key = $2",
        );
        let find = find.bind(tenant.as_str()).bind(key);
        self.list("reading a job", find, |rows| rows.first().map(JobRow::from_row).transpose()).await
    }

    /// Returns the report of a tenant's succeeded job.
    pub async fn report(&self, tenant: &Tenant, job: &str) -> Result<Option<String>, StoreError> {
        let find = query(
            "SELECT json FROM job_reports JOIN jobs ON jobs.job = job_reports.job
             WHERE jobs.job = $1 AND tenant = $2",
        );
        let find = find.bind(job).bind(tenant.as_str());
        self.list("reading a report", find, |rows| rows.first().map(|row| row.get("json")).transpose()).await
    }

    /// Returns the length of the report of a job, in bytes.
    pub async fn report_bytes(&self, tenant: &Tenant, job: &str) -> Result<Option<usize>, StoreError> {
        let find = query(
            "SELECT CAST(octet_length(json) AS BIGINT) AS bytes FROM job_reports JOIN jobs ON jobs.job = job_reports.job
             WHERE jobs.job = $1 AND tenant = $2",
        );
        let find = find.bind(job).bind(tenant.as_str());
        self.list("measuring a report", find, |rows| rows.first().map(|row| row.length("bytes")).transpose()).await
    }

    /// Returns whether a user asked for the job to stop; false if there is no such job.
    pub async fn is_to_stop(&self, job: &str) -> Result<bool, StoreError> {
        let find = query("SELECT cancel_requested FROM jobs WHERE job = $1").bind(job);
        let requested = self.probe("checking whether a job must stop", find, |rows| {
            rows.first().map(|row| row.get("cancel_requested")).transpose()
        });
        Ok(requested.await?.unwrap_or(false))
    }

    /// Returns at most `limit` jobs of a tenant, newest first; `after` is the `sequence` of the last row of the page
    /// before.
    pub async fn jobs(&self, tenant: &Tenant, limit: usize, after: Option<i64>) -> Result<Vec<JobRow>, StoreError> {
        let page = query("SELECT * FROM jobs WHERE tenant = $1 AND sequence < $2 ORDER BY sequence DESC LIMIT $3")
            .bind(tenant.as_str())
            .bind(after.unwrap_or(i64::MAX))
            .bind(to_sql(limit));
        self.list("listing jobs", page, |rows| rows.iter().map(JobRow::from_row).collect()).await
    }

    /// Cancels a queued job at once and flags a running one; a terminal job stays as it is. Returns `None` if there is
    /// no such job, else the job as it is now.
    pub async fn request_cancel(&self, job: &str, now_ms: i64) -> Result<Option<JobRow>, StoreError> {
        let (job, actor) = (job.to_owned(), self.actor.clone());
        self.write("cancelling a job", move |connection| cancel(connection, job, actor, now_ms).boxed()).await
    }

    pub async fn count_jobs_by_state(&self) -> Result<JobCounts, StoreError> {
        let count = query("SELECT state, count(*) AS jobs FROM jobs GROUP BY state");
        self.probe("counting jobs", count, |rows| {
            let mut counts = JobCounts::default();
            for row in rows {
                let state: String = row.get("state")?;
                let jobs = row.get::<i64>("jobs")?.unsigned_abs();
                match JobState::parse(&state) {
                    Some(JobState::Queued) => counts.queued = jobs,
                    Some(JobState::Running) => counts.running = jobs,
                    Some(JobState::Succeeded) => counts.succeeded = jobs,
                    Some(JobState::Failed) => counts.failed = jobs,
                    Some(JobState::Cancelled) => counts.cancelled = jobs,
                    None => return Err(Failure::Corrupt(format!("the state {state} of a job"))),
                }
            }
            Ok(counts)
        })
        .await
    }

    pub async fn oldest_jobs(&self) -> Result<OldestJobs, StoreError> {
        let oldest = query(
            "SELECT (SELECT created_ms FROM jobs WHERE state = $1 ORDER BY sequence LIMIT 1) AS queued_ms,
                    (SELECT min(started_ms) FROM jobs WHERE state = $2) AS running_ms",
        );
        let oldest = oldest.bind(JobState::Queued.as_str()).bind(JobState::Running.as_str());
        self.probe("finding the oldest jobs", oldest, |rows| {
            let Some(row) = rows.first() else { return Ok(OldestJobs::default()) };
            Ok(OldestJobs { queued_ms: row.get("queued_ms")?, running_ms: row.get("running_ms")? })
        })
        .await
    }
}

/// Creates a job while the tenant's turn is locked: no other transaction queues a job for the tenant, nor takes its
/// idempotency key, in between.
async fn create(
    mut connection: StoreConnection<'_>,
    new: NewJob,
    quotas: Quotas,
    actor: Actor,
) -> Result<CreateJob, Failure> {
    let connection = &mut connection;
    turns::enter(connection, &new.tenant).await?;
    if let Some(key) = &new.idempotency_key
        && let Some(earlier) = repeated(connection, &new.tenant, key, &new.request_hash).await?
    {
        return Ok(earlier);
    }
    quotas::admit_job(connection, &new.tenant, quotas).await?;
    let bytes = insert(connection, &new).await?;
    if let Some(key) = &new.idempotency_key {
        let take = query(
            "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, job) VALUES ($1, $2, $3, $4)
             ON CONFLICT (tenant, idempotency_key) DO NOTHING",
        );
        let take = take.bind(new.tenant.as_str()).bind(key.as_str()).bind(new.request_hash.as_str());
        if connection.execute(take.bind(new.job.as_str())).await? == 0 {
            // A session took the key in the meantime.
            connection.execute(query("DELETE FROM jobs WHERE job = $1").bind(new.job)).await?;
            return Ok(CreateJob::KeyConflict);
        }
    }
    training_names::name_training(connection, &new).await?;
    count(connection, &new, bytes, quotas, actor).await.map(CreateJob::Created)
}

/// Inserts a job and its request, and returns the bytes that they take.
pub(super) async fn insert(connection: &mut StoreConnection<'_>, new: &NewJob) -> Result<i64, Failure> {
    let insert =
        query("INSERT INTO jobs (job, kind, state, steps_total, created_ms, tenant) VALUES ($1, $2, $3, $4, $5, $6)");
    let insert = insert
        .bind(new.job.as_str())
        .bind(new.kind.as_str())
        .bind(JobState::Queued.as_str())
        .bind(to_sql(new.steps_total))
        .bind(new.created_ms)
        .bind(new.tenant.as_str());
    connection.execute(insert).await?;
    let labels = labels_json(&new.labels)?;
    let bytes = ROW_BYTES + quotas::length(new.request_json.as_bytes()) + quotas::length(labels.as_bytes());
    let request = query("INSERT INTO job_requests (job, json, labels_json) VALUES ($1, $2, $3)");
    let request = request.bind(new.job.as_str()).bind(new.request_json.as_str()).bind(labels);
    connection.execute(request).await?;
    Ok(bytes)
}

/// Counts the bytes of a new job, and records it in the audit.
pub(super) async fn count(
    connection: &mut StoreConnection<'_>,
    new: &NewJob,
    bytes: i64,
    quotas: Quotas,
    actor: Actor,
) -> Result<JobRow, Failure> {
    quotas::take(connection, &new.tenant, Usage::of_bytes(bytes), quotas).await?;
    let outcome = format!("queued, {}", new.kind.as_str());
    audit_chain::record(connection, (quotas, &actor), &new.tenant, AuditAction::QueueJob, &new.job, &outcome).await?;
    let row = find(connection, &new.job).await?;
    row.ok_or_else(|| Failure::Corrupt(format!("the new job {}", new.job)))
}

/// Returns the answer for an idempotency key that was used before; `None` for a new key.
async fn repeated(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    key: &str,
    request_hash: &str,
) -> Result<Option<CreateJob>, Failure> {
    let used = query("SELECT request_hash, job FROM idempotency_keys WHERE tenant = $1 AND idempotency_key = $2");
    let used = used.bind(tenant.as_str()).bind(key);
    let Some(used) = connection.row(used).await? else { return Ok(None) };
    if used.get::<String>("request_hash")? != request_hash {
        return Ok(Some(CreateJob::KeyConflict));
    }
    let job: String = used.get("job")?;
    match find(connection, &job).await? {
        Some(row) => Ok(Some(CreateJob::Repeated(row))),
        None => Err(Failure::Corrupt(format!("the idempotency key of job {job}"))),
    }
}

/// Finds the job and locks it for this transaction.
pub(super) async fn find(connection: &mut StoreConnection<'_>, job: &str) -> Result<Option<JobRow>, Failure> {
    let find = query("SELECT * FROM jobs WHERE job = $1").bind(job).for_update();
    connection.row(find).await?.as_ref().map(JobRow::from_row).transpose()
}

pub(super) async fn cancel(
    mut connection: StoreConnection<'_>,
    job: String,
    actor: Actor,
    now_ms: i64,
) -> Result<Option<JobRow>, Failure> {
    let connection = &mut connection;
    let Some(row) = find(connection, &job).await? else { return Ok(None) };
    let Ok(next) = row.state.next(JobEvent::RequestCancel) else { return Ok(Some(row)) };
    if next.is_terminal() {
        end(connection, &row, next, now_ms).await?;
    } else {
        connection.execute(query("UPDATE jobs SET cancel_requested = TRUE WHERE job = $1").bind(job.as_str())).await?;
    }
    let outcome = if next.is_terminal() { "cancelled" } else { "stop requested" };
    audit_chain::record(connection, (Quotas::NONE, &actor), &row.tenant, AuditAction::CancelJob, &job, outcome).await?;
    find(connection, &job).await
}

/// Sets a terminal state, stores its events, and deletes the checkpoints and the request, which are no longer needed.
/// The reason of a failure is set before.
pub(super) async fn end(
    connection: &mut StoreConnection<'_>,
    row: &JobRow,
    state: JobState,
    now_ms: i64,
) -> Result<(), Failure> {
    let job = row.job.as_str();
    // First, because a deletion of the job's request also takes the totals of its tenant.
    events::publish_job(connection, row, state, now_ms).await?;
    connection.execute(query("DELETE FROM checkpoints WHERE job = $1").bind(job)).await?;
    let end = query(
        "UPDATE jobs SET state = $1, finished_ms = $2, cancel_requested = FALSE, worker = NULL, lease_until_ms = NULL
         WHERE job = $3",
    );
    connection.execute(end.bind(state.as_str()).bind(now_ms).bind(job)).await?;
    let request = query(
        "DELETE FROM job_requests WHERE job = $1
             RETURNING CAST(octet_length(json) + octet_length(labels_json) AS BIGINT) AS bytes",
    )
    .bind(job);
    let bytes = sum(&connection.rows(request).await?)?;
    quotas::change(connection, &row.tenant, Usage::of_bytes(-bytes)).await.map(drop)
}

/// Encodes labels for their column; empty if there are none.
fn labels_json(labels: &Relabel) -> Result<String, Failure> {
    if labels.is_empty() {
        return Ok(String::new());
    }
    serde_json::to_string(labels).map_err(|error| Failure::Corrupt(format!("labels that cannot be written ({error})")))
}

/// Reads the labels for the policy of a job.
pub(super) async fn labels_of(connection: &mut StoreConnection<'_>, job: &str) -> Result<Relabel, Failure> {
    let find = query("SELECT labels_json FROM job_requests WHERE job = $1").bind(job);
    let found: String = connection.row(find).await?.map_or(Ok(String::new()), |row| row.get("labels_json"))?;
    if found.is_empty() {
        return Ok(Relabel::default());
    }
    serde_json::from_str(&found).map_err(|error| Failure::Corrupt(format!("the labels of job {job} ({error})")))
}

/// Sums the column `bytes`.
fn sum(rows: &[StoreRow]) -> Result<i64, Failure> {
    rows.iter().map(|row| row.get::<i64>("bytes")).sum()
}
