//! Jobs as workers see them: claimed under a lease, checkpointed, finished.
//!
//! A worker holds a job until its lease runs out. Every claim raises `attempt`, and every write names the attempt it
//! was claimed under. If a worker sleeps past its lease and another worker claims the job, the first is fenced: its
//! writes return `false`, and it must drop the job.
//!
//! A job that is claimed while it runs has lost its worker: the process died or was silent past the lease, which cannot
//! be distinguished. A job that loses [`MOST_DEATHS`] workers between two checkpoints fails, because a job that
//! repeatedly ends its process must not take down one worker after another. A worker that stops in order releases its
//! job, which does not count as a death.

use futures_util::FutureExt;

use crate::control::policy::periods_per_year;
use crate::store::engine::codec::{Seal, from_sql, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{Query, StoreConnection, StoreRow, query};
use crate::store::jobs::job::{ClaimedJob, JobOutcome, JobRow};
use crate::store::jobs::state::{JobEvent, JobState};
use crate::store::jobs::{end, find, labels_of, turns};
use crate::store::sessions::words::{Labelled, Worded};
use crate::store::tenants::quotas::{self, Quotas, Usage};
use crate::store::{Store, StoreError, labels, policies};

/// The job fails once this many workers died under it between two checkpoints.
const MOST_DEATHS: i64 = 3;

impl Store {
    /// Claims a job until `now_ms + 1000 lease_seconds`: the oldest job whose worker's lease ran out, else the queued
    /// job whose turn it is (`crate::store::jobs::turns`). On the way, a job that was asked to stop is cancelled instead of claimed,
    /// and a job under which too many workers died fails.
    pub async fn claim_job(
        &self,
        worker: &str,
        lease_seconds: u32,
        now_ms: i64,
    ) -> Result<Option<ClaimedJob>, StoreError> {
        let worker = worker.to_owned();
        let until_ms = now_ms.saturating_add(1000 * i64::from(lease_seconds));
        self.write("claiming a job", move |connection| claim(connection, worker, until_ms, now_ms).boxed()).await
    }

    /// Holds the job until `until_ms`. Returns false when fenced.
    pub async fn renew_lease(&self, job: &str, attempt: i64, until_ms: i64) -> Result<bool, StoreError> {
        let job = job.to_owned();
        self.write("renewing a lease", move |connection| renew(connection, job, attempt, until_ms).boxed()).await
    }

    /// Stores the solution of one step, replacing an earlier one. Returns false when fenced.
    pub async fn save_checkpoint(
        &self,
        job: &str,
        attempt: i64,
        step: usize,
        bytes: &[u8],
    ) -> Result<bool, StoreError> {
        let (job, bytes, step) = (job.to_owned(), bytes.to_vec(), to_sql(step));
        self.write("saving a checkpoint", move |connection| checkpoint(connection, job, attempt, step, bytes).boxed())
            .await
    }

    /// Returns every checkpoint of the job, ascending by step, each verified against its seal.
    pub async fn checkpoints(&self, job: &str) -> Result<Vec<(usize, Vec<u8>)>, StoreError> {
        self.read("reading checkpoints", checkpoints_of(job), |rows| verified_checkpoints(job, rows)).await
    }

    /// Stores the result, sets the terminal state and deletes the checkpoints, all or nothing. Returns false when
    /// fenced.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if a policy's name is not the hash of its bytes.
    pub async fn finish_job(
        &self,
        job: &str,
        attempt: i64,
        outcome: JobOutcome,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let mut year = None;
        if let JobOutcome::Succeeded { policy_id, policy_json } = &outcome {
            policies::verify(policy_id, policy_json).map_err(|failure| failure.during("finishing a job"))?;
            year = periods_per_year(policy_json);
        }
        let job = job.to_owned();
        self.write("finishing a job", move |connection| {
            finish(connection, job, attempt, (outcome, year), now_ms).boxed()
        })
        .await
    }

    /// Puts the job back in the queue with its checkpoints, or cancels it if it was asked to stop. Returns false when
    /// fenced.
    pub async fn release_job(&self, job: &str, attempt: i64, now_ms: i64) -> Result<bool, StoreError> {
        let job = job.to_owned();
        self.write("releasing a job", move |connection| release(connection, job, attempt, now_ms).boxed()).await
    }
}

async fn claim(
    mut connection: StoreConnection<'_>,
    worker: String,
    until_ms: i64,
    now_ms: i64,
) -> Result<Option<ClaimedJob>, Failure> {
    let connection = &mut connection;
    while let Some(row) = claimable(connection, now_ms).await? {
        if row.cancel_requested
            && let Ok(next) = row.state.next(JobEvent::Cancel)
        {
            end(connection, &row, next, now_ms).await?;
            continue;
        }
        let deaths = row.deaths + i64::from(row.state == JobState::Running);
        if deaths >= MOST_DEATHS
            && let Ok(next) = row.state.next(JobEvent::Fail)
        {
            let reason = format!(
                "its worker process ended {deaths} times while the job ran, and no step was finished in between; \
                 the job may need more memory than the machine has"
            );
            let fail = query("UPDATE jobs SET error = $1, deaths = $2 WHERE job = $3");
            connection.execute(fail.bind(reason).bind(deaths).bind(row.job.as_str())).await?;
            end(connection, &row, next, now_ms).await?;
            continue;
        }
        let next = row.state.next(JobEvent::Claim).map_err(|error| Failure::Corrupt(error.to_string()))?;
        let take = query(
            "UPDATE jobs SET state = $1, worker = $2, lease_until_ms = $3, attempt = attempt + 1,
                             started_ms = coalesce(started_ms, $4), deaths = $5
             WHERE job = $6",
        );
        let take =
            take.bind(next.as_str()).bind(worker).bind(until_ms).bind(now_ms).bind(deaths).bind(row.job.as_str());
        connection.execute(take).await?;
        return claimed(connection, &row.job).await.map(Some);
    }
    Ok(None)
}

async fn claimed(connection: &mut StoreConnection<'_>, job: &str) -> Result<ClaimedJob, Failure> {
    let request = connection.row(query("SELECT json FROM job_requests WHERE job = $1").bind(job)).await?;
    let request_json = request.map(|row| row.get("json")).transpose()?;
    match (find(connection, job).await?, request_json) {
        (Some(row), Some(request_json)) => Ok(ClaimedJob { attempt: row.attempt, row, request_json }),
        _ => Err(Failure::Corrupt(format!("the request of job {job}"))),
    }
}

/// Finds and locks a job to take over, which has had its turn already; else the one whose turn it is.
async fn claimable(connection: &mut StoreConnection<'_>, now_ms: i64) -> Result<Option<JobRow>, Failure> {
    let left = query("SELECT * FROM jobs WHERE state = $1 AND lease_until_ms <= $2 ORDER BY sequence LIMIT 1");
    let left = left.bind(JobState::Running.as_str()).bind(now_ms);
    match connection.row(left.for_update_of_free()).await? {
        Some(row) => JobRow::from_row(&row).map(Some),
        None => turns::take(connection).await,
    }
}

async fn renew(mut connection: StoreConnection<'_>, job: String, attempt: i64, until_ms: i64) -> Result<bool, Failure> {
    let renew = query("UPDATE jobs SET lease_until_ms = $1 WHERE job = $2 AND attempt = $3 AND state = $4")
        .bind(until_ms)
        .bind(job)
        .bind(attempt)
        .bind(JobState::Running.as_str());
    Ok(connection.execute(renew).await? > 0)
}

/// Returns the job if this attempt still holds it, and locks it until this transaction ends.
async fn held(connection: &mut StoreConnection<'_>, job: &str, attempt: i64) -> Result<Option<JobRow>, Failure> {
    let row = find(connection, job).await?;
    Ok(row.filter(|row| row.state == JobState::Running && row.attempt == attempt))
}

async fn checkpoint(
    mut connection: StoreConnection<'_>,
    job: String,
    attempt: i64,
    step: i64,
    bytes: Vec<u8>,
) -> Result<bool, Failure> {
    let connection = &mut connection;
    if held(connection, &job, attempt).await?.is_none() {
        return Ok(false);
    }
    let seal = checkpoint_seal(&job, step, &bytes).finish();
    let save = query(
        "INSERT INTO checkpoints (job, step, bytes, seal) VALUES ($1, $2, $3, $4)
         ON CONFLICT (job, step) DO UPDATE SET bytes = excluded.bytes, seal = excluded.seal",
    );
    connection.execute(save.bind(job.as_str()).bind(step).bind(bytes).bind(seal)).await?;
    let count = query(
        "UPDATE jobs SET steps_done = (SELECT count(*) FROM checkpoints WHERE job = $1), deaths = 0 WHERE job = $1",
    );
    connection.execute(count.bind(job)).await?;
    Ok(true)
}

pub(in crate::store) fn checkpoints_of(job: &str) -> Query {
    query("SELECT step, bytes, seal FROM checkpoints WHERE job = $1 ORDER BY step").bind(job)
}

/// Decodes the rows of [`checkpoints_of`], verifying each against its seal.
pub(in crate::store) fn verified_checkpoints(job: &str, rows: &[StoreRow]) -> Result<Vec<(usize, Vec<u8>)>, Failure> {
    let verified = |row: &StoreRow| {
        let (step, bytes) = (row.get("step")?, row.get::<Vec<u8>>("bytes")?);
        let what = || format!("the checkpoint of step {step} of job {job}");
        checkpoint_seal(job, step, &bytes).verify(&row.get::<Vec<u8>>("seal")?, what)?;
        Ok((from_sql(step)?, bytes))
    };
    rows.iter().map(verified).collect()
}

fn checkpoint_seal(job: &str, step: i64, bytes: &[u8]) -> Seal {
    Seal::of("checkpoint").text(job).integer(step).bytes(bytes)
}

async fn finish(
    mut connection: StoreConnection<'_>,
    job: String,
    attempt: i64,
    (outcome, year): (JobOutcome, Option<f64>),
    now_ms: i64,
) -> Result<bool, Failure> {
    let connection = &mut connection;
    let Some(row) = held(connection, &job, attempt).await? else { return Ok(false) };
    let event = match &outcome {
        JobOutcome::Succeeded { .. } | JobOutcome::Reported { .. } => JobEvent::Succeed,
        JobOutcome::Failed { .. } => JobEvent::Fail,
        JobOutcome::Cancelled => JobEvent::Cancel,
    };
    let Ok(next) = row.state.next(event) else { return Ok(false) };
    let update = match outcome {
        JobOutcome::Succeeded { policy_id, policy_json } => {
            policies::insert(connection, &row.tenant, &policy_id, (policy_json, year), now_ms, Quotas::NONE).await?;
            let labels = labels_of(connection, &job).await?;
            if !labels.is_empty() {
                let kind = Labelled::Policy;
                let held = labels::hold(connection, &row.tenant, kind, &policy_id).await?;
                let sequence = held.ok_or_else(|| Failure::Corrupt(format!("the owner of policy {policy_id}")))?;
                let of = Worded { tenant: &row.tenant, kind, sequence };
                let (_, grown) = labels::put(connection, of, &policy_id, &labels).await?;
                quotas::change(connection, &row.tenant, grown).await?;
            }
            query("UPDATE jobs SET policy = $1, steps_done = steps_total WHERE job = $2").bind(policy_id).bind(job)
        }
        JobOutcome::Reported { report_json } => {
            let bytes = Usage::of_bytes(quotas::length(report_json.as_bytes()));
            let report = query("INSERT INTO job_reports (job, json) VALUES ($1, $2)").bind(job.as_str());
            connection.execute(report.bind(report_json)).await?;
            quotas::change(connection, &row.tenant, bytes).await?;
            query("UPDATE jobs SET steps_done = steps_total WHERE job = $1").bind(job)
        }
        JobOutcome::Failed { reason } => query("UPDATE jobs SET error = $1 WHERE job = $2").bind(reason).bind(job),
        JobOutcome::Cancelled => query("UPDATE jobs SET error = NULL WHERE job = $1").bind(job),
    };
    connection.execute(update).await?;
    end(connection, &row, next, now_ms).await?;
    Ok(true)
}

async fn release(mut connection: StoreConnection<'_>, job: String, attempt: i64, now_ms: i64) -> Result<bool, Failure> {
    let connection = &mut connection;
    let Some(row) = held(connection, &job, attempt).await? else { return Ok(false) };
    let event = if row.cancel_requested { JobEvent::Cancel } else { JobEvent::Release };
    let Ok(next) = row.state.next(event) else { return Ok(false) };
    if next.is_terminal() {
        end(connection, &row, next, now_ms).await?;
        return Ok(true);
    }
    let release = query("UPDATE jobs SET state = $1, worker = NULL, lease_until_ms = NULL WHERE job = $2");
    connection.execute(release.bind(next.as_str()).bind(job)).await?;
    Ok(true)
}
