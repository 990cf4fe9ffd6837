//! Jobs as users see them: created once, listed, cancelled.

use futures_util::FutureExt;
use sqlx::SqliteConnection;

use super::codec::to_sql;
use super::error::Failure;
use super::job::{CreateJob, JobCounts, JobRow, NewJob};
use super::job_state::{JobEvent, JobState};
use super::{Store, StoreError};

impl Store {
    /// Queues a job and records its idempotency key, both or neither.
    pub async fn create_job(&self, new: NewJob) -> Result<CreateJob, StoreError> {
        self.write("creating a job", move |connection| create(connection, new).boxed()).await
    }

    pub async fn job(&self, job: &str) -> Result<Option<JobRow>, StoreError> {
        let row = sqlx::query("SELECT * FROM jobs WHERE job = ?").bind(job).fetch_optional(&self.readers);
        self.read("reading a job", async { row.await?.as_ref().map(JobRow::from_row).transpose() }).await
    }

    /// At most `limit` jobs, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn jobs(&self, limit: usize, after: Option<i64>) -> Result<Vec<JobRow>, StoreError> {
        let rows = sqlx::query("SELECT * FROM jobs WHERE sequence < ? ORDER BY sequence DESC LIMIT ?")
            .bind(after.unwrap_or(i64::MAX))
            .bind(to_sql(limit))
            .fetch_all(&self.readers);
        self.read("listing jobs", async { rows.await?.iter().map(JobRow::from_row).collect() }).await
    }

    /// Cancels a queued job at once and flags a running one; a terminal job stays as it is. `None` where there is no such
    /// job, else the job as it is now.
    pub async fn request_cancel(&self, job: &str, now_ms: i64) -> Result<Option<JobRow>, StoreError> {
        let job = job.to_owned();
        self.write("cancelling a job", move |connection| cancel(connection, job, now_ms).boxed()).await
    }

    pub async fn count_jobs_by_state(&self) -> Result<JobCounts, StoreError> {
        let rows = sqlx::query_as("SELECT state, count(*) FROM jobs GROUP BY state").fetch_all(&self.readers);
        self.read("counting jobs", async {
            let rows: Vec<(String, i64)> = rows.await?;
            let count = |state: JobState| {
                let found = rows.iter().find(|(name, _)| name == state.as_str());
                found.map_or(0, |&(_, count)| count.unsigned_abs())
            };
            Ok(JobCounts {
                queued: count(JobState::Queued),
                running: count(JobState::Running),
                succeeded: count(JobState::Succeeded),
                failed: count(JobState::Failed),
                cancelled: count(JobState::Cancelled),
            })
        })
        .await
    }
}

async fn create(connection: &mut SqliteConnection, new: NewJob) -> Result<CreateJob, Failure> {
    if let Some(key) = &new.idempotency_key
        && let Some(earlier) = repeated(connection, key, &new.request_hash).await?
    {
        return Ok(earlier);
    }
    let row = sqlx::query(
        "INSERT INTO jobs (job, kind, state, request_json, steps_total, created_ms) VALUES (?, ?, ?, ?, ?, ?) RETURNING *",
    )
    .bind(&new.job)
    .bind(new.kind.as_str())
    .bind(JobState::Queued.as_str())
    .bind(&new.request_json)
    .bind(to_sql(new.steps_total))
    .bind(new.created_ms)
    .fetch_one(&mut *connection)
    .await?;
    if let Some(key) = &new.idempotency_key {
        sqlx::query("INSERT INTO idempotency_keys (idempotency_key, request_hash, job) VALUES (?, ?, ?)")
            .bind(key)
            .bind(&new.request_hash)
            .bind(&new.job)
            .execute(connection)
            .await?;
    }
    Ok(CreateJob::Created(JobRow::from_row(&row)?))
}

/// What an idempotency key used before answers; `None` for a new key.
async fn repeated(
    connection: &mut SqliteConnection,
    key: &str,
    request_hash: &str,
) -> Result<Option<CreateJob>, Failure> {
    let used: Option<(String, String)> =
        sqlx::query_as("SELECT request_hash, job FROM idempotency_keys WHERE idempotency_key = ?")
            .bind(key)
            .fetch_optional(&mut *connection)
            .await?;
    match used {
        None => Ok(None),
        Some((hash, _)) if hash != request_hash => Ok(Some(CreateJob::KeyConflict)),
        Some((_, job)) => match find(connection, &job).await? {
            Some(row) => Ok(Some(CreateJob::Repeated(row))),
            None => Err(Failure::Corrupt(format!("the idempotency key of job {job}"))),
        },
    }
}

pub(super) async fn find(connection: &mut SqliteConnection, job: &str) -> Result<Option<JobRow>, Failure> {
    let row = sqlx::query("SELECT * FROM jobs WHERE job = ?").bind(job).fetch_optional(connection).await?;
    row.as_ref().map(JobRow::from_row).transpose()
}

async fn cancel(connection: &mut SqliteConnection, job: String, now_ms: i64) -> Result<Option<JobRow>, Failure> {
    let Some(row) = find(connection, &job).await? else { return Ok(None) };
    let Ok(next) = row.state.next(JobEvent::RequestCancel) else { return Ok(Some(row)) };
    if next.is_terminal() {
        end(connection, &row, next, now_ms).await?;
    } else {
        sqlx::query("UPDATE jobs SET cancel_requested = 1 WHERE job = ?").bind(&job).execute(&mut *connection).await?;
    }
    find(connection, &job).await
}

/// Sets a terminal state and deletes the checkpoints.
pub(super) async fn end(
    connection: &mut SqliteConnection,
    row: &JobRow,
    state: JobState,
    now_ms: i64,
) -> Result<(), Failure> {
    sqlx::query("DELETE FROM checkpoints WHERE job = ?").bind(&row.job).execute(&mut *connection).await?;
    sqlx::query(
        "UPDATE jobs SET state = ?, finished_ms = ?, cancel_requested = 0, worker = NULL, lease_until_ms = NULL WHERE job = ?",
    )
    .bind(state.as_str())
    .bind(now_ms)
    .bind(&row.job)
    .execute(connection)
    .await?;
    Ok(())
}
