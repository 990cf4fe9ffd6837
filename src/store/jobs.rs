//! Jobs as users see them: created once, listed, cancelled.

use futures_util::FutureExt;

use super::audit::{self, Actor, Deed};
use super::codec::to_sql;
use super::error::Failure;
use super::job::{CreateJob, JobCounts, JobRow, NewJob};
use super::job_state::{JobEvent, JobState};
use super::query::{Connection, query};
use super::tenant::Tenant;
use super::{Store, StoreError};

impl Store {
    /// Queues a job and records its idempotency key, both or neither.
    pub async fn create_job(&self, new: NewJob) -> Result<CreateJob, StoreError> {
        let actor = self.actor.clone();
        self.write("creating a job", move |connection| create(connection, new, actor).boxed()).await
    }

    pub async fn job(&self, job: &str) -> Result<Option<JobRow>, StoreError> {
        let find = query("SELECT * FROM jobs WHERE job = $1").bind(job);
        self.read("reading a job", find, |rows| rows.first().map(JobRow::from_row).transpose()).await
    }

    /// At most `limit` jobs of a tenant, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn jobs(&self, tenant: &Tenant, limit: usize, after: Option<i64>) -> Result<Vec<JobRow>, StoreError> {
        let page = query("SELECT * FROM jobs WHERE tenant = $1 AND sequence < $2 ORDER BY sequence DESC LIMIT $3")
            .bind(tenant.as_str())
            .bind(after.unwrap_or(i64::MAX))
            .bind(to_sql(limit));
        self.read("listing jobs", page, |rows| rows.iter().map(JobRow::from_row).collect()).await
    }

    /// Cancels a queued job at once and flags a running one; a terminal job stays as it is. `None` where there is no such
    /// job, else the job as it is now.
    pub async fn request_cancel(&self, job: &str, now_ms: i64) -> Result<Option<JobRow>, StoreError> {
        let (job, actor) = (job.to_owned(), self.actor.clone());
        self.write("cancelling a job", move |connection| cancel(connection, job, actor, now_ms).boxed()).await
    }

    pub async fn count_jobs_by_state(&self) -> Result<JobCounts, StoreError> {
        let count = query("SELECT state, count(*) AS jobs FROM jobs GROUP BY state");
        self.read("counting jobs", count, |rows| {
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
}

async fn create(mut connection: Connection<'_>, new: NewJob, actor: Actor) -> Result<CreateJob, Failure> {
    let connection = &mut connection;
    if let Some(key) = &new.idempotency_key
        && let Some(earlier) = repeated(connection, &new.tenant, key, &new.request_hash).await?
    {
        return Ok(earlier);
    }
    let insert = query(
        "INSERT INTO jobs (job, kind, state, request_json, steps_total, created_ms, tenant)
         VALUES ($1, $2, $3, $4, $5, $6, $7)",
    );
    let insert = insert
        .bind(new.job.as_str())
        .bind(new.kind.as_str())
        .bind(JobState::Queued.as_str())
        .bind(new.request_json)
        .bind(to_sql(new.steps_total))
        .bind(new.created_ms)
        .bind(new.tenant.as_str());
    connection.execute(insert).await?;
    if let Some(key) = &new.idempotency_key {
        let take = query(
            "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, job) VALUES ($1, $2, $3, $4)
             ON CONFLICT (tenant, idempotency_key) DO NOTHING",
        );
        let take =
            take.bind(new.tenant.as_str()).bind(key.as_str()).bind(new.request_hash.as_str()).bind(new.job.as_str());
        if connection.execute(take).await? == 0 {
            // Somebody else took the key in the meantime.
            connection.execute(query("DELETE FROM jobs WHERE job = $1").bind(new.job)).await?;
            let earlier = repeated(connection, &new.tenant, key, &new.request_hash).await?;
            return earlier.ok_or_else(|| Failure::Corrupt(format!("the idempotency key {key}")));
        }
    }
    let outcome = format!("queued, {}", new.kind.as_str());
    audit::record(connection, &actor, &new.tenant, Deed::QueueJob, &new.job, &outcome).await?;
    let row = find(connection, &new.job).await?;
    row.map(CreateJob::Created).ok_or_else(|| Failure::Corrupt(format!("the new job {}", new.job)))
}

/// What an idempotency key used before answers; `None` for a new key.
async fn repeated(
    connection: &mut Connection<'_>,
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

/// The job, to be changed by this transaction alone.
pub(super) async fn find(connection: &mut Connection<'_>, job: &str) -> Result<Option<JobRow>, Failure> {
    let find = query("SELECT * FROM jobs WHERE job = $1").bind(job).for_update();
    connection.row(find).await?.as_ref().map(JobRow::from_row).transpose()
}

async fn cancel(
    mut connection: Connection<'_>,
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
    let outcome = if next.is_terminal() { "cancelled" } else { "asked to stop" };
    audit::record(connection, &actor, &row.tenant, Deed::CancelJob, &job, outcome).await?;
    find(connection, &job).await
}

/// Sets a terminal state and deletes the checkpoints.
pub(super) async fn end(
    connection: &mut Connection<'_>,
    row: &JobRow,
    state: JobState,
    now_ms: i64,
) -> Result<(), Failure> {
    connection.execute(query("DELETE FROM checkpoints WHERE job = $1").bind(row.job.as_str())).await?;
    let end = query(
        "UPDATE jobs SET state = $1, finished_ms = $2, cancel_requested = FALSE, worker = NULL, lease_until_ms = NULL
         WHERE job = $3",
    );
    connection.execute(end.bind(state.as_str()).bind(now_ms).bind(row.job.as_str())).await?;
    Ok(())
}
