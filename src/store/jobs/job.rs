//! Stored jobs.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::store::engine::codec::from_sql;
use crate::store::engine::error::Failure;
use crate::store::engine::query::StoreRow;
use crate::store::jobs::state::JobState;
use crate::store::labels::Relabel;
use crate::store::tenants::tenant::Tenant;

/// The kind of computation that a job runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    Train,
    Evaluate,
    Backtest,
    Frontier,
}

impl JobKind {
    /// The name on the wire and in SQL.
    pub fn as_str(self) -> &'static str {
        match self {
            JobKind::Train => "train",
            JobKind::Evaluate => "evaluate",
            JobKind::Backtest => "backtest",
            JobKind::Frontier => "frontier",
        }
    }

    pub(in crate::store) fn parse(name: &str) -> Option<JobKind> {
        let all = [JobKind::Train, JobKind::Evaluate, JobKind::Backtest, JobKind::Frontier];
        all.into_iter().find(|kind| kind.as_str() == name)
    }
}

/// A job to queue.
#[derive(Debug, Clone, PartialEq)]
pub struct NewJob {
    pub job: String,
    pub tenant: Tenant,
    pub kind: JobKind,
    /// The completed request, as the worker reads it back.
    pub request_json: String,
    /// Hash of the request as the user sent it; distinguishes a repeat from another request under the same key.
    pub request_hash: String,
    pub idempotency_key: Option<String>,
    pub steps_total: usize,
    /// The labels for the policy of a training.
    pub labels: Relabel,
    pub created_ms: i64,
}

/// A job as stored, without its request and its report.
#[derive(Debug, Clone, PartialEq)]
pub struct JobRow {
    /// Order of creation; the cursor of [`Store::jobs`](crate::store::Store::jobs).
    pub sequence: i64,
    pub job: String,
    pub tenant: Tenant,
    pub kind: JobKind,
    pub state: JobState,
    pub steps_total: usize,
    /// Number of checkpoints saved; equals `steps_total` once succeeded.
    pub steps_done: usize,
    /// True if a user asked for it to stop and its worker has not stopped yet.
    pub cancel_requested: bool,
    /// How often it was claimed: the fencing token of its present worker.
    pub attempt: i64,
    /// How many workers died under it, or fell silent past their lease, since it last saved a checkpoint.
    pub deaths: i64,
    /// The policy of a succeeded training, even if that policy was deleted since.
    pub policy: Option<String>,
    /// The reason why it failed.
    pub error: Option<String>,
    pub created_ms: i64,
    /// The time it was first claimed.
    pub started_ms: Option<i64>,
    /// The time it reached its terminal state.
    pub finished_ms: Option<i64>,
}

/// The outcome of creating a [`NewJob`].
#[derive(Debug, Clone, PartialEq)]
pub enum CreateJob {
    Created(JobRow),
    /// The tenant used the idempotency key with the same request: the job it made, as it is now.
    Repeated(JobRow),
    /// The tenant used the idempotency key with another request.
    KeyConflict,
}

/// A job held by a worker, until its lease runs out.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimedJob {
    pub row: JobRow,
    pub request_json: String,
    /// The attempt that every write of this worker must name.
    pub attempt: i64,
}

/// How a worker ends a job.
#[derive(Debug, Clone, PartialEq)]
pub enum JobOutcome {
    /// `policy_id` is the [content hash](crate::control::policy::content_hash) of `policy_json`.
    Succeeded {
        policy_id: String,
        policy_json: Vec<u8>,
    },
    /// A job whose result is a report instead of a policy.
    Reported {
        report_json: String,
    },
    Failed {
        reason: String,
    },
    Cancelled,
}

/// Number of jobs in each state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct JobCounts {
    pub queued: u64,
    pub running: u64,
    pub succeeded: u64,
    pub failed: u64,
    pub cancelled: u64,
}

/// The start of the longest wait among queued jobs, and of the longest run among running jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OldestJobs {
    pub queued_ms: Option<i64>,
    pub running_ms: Option<i64>,
}

impl JobRow {
    pub(in crate::store) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let job: String = row.get("job")?;
        let damaged = |column: &str| Failure::Corrupt(format!("the {column} of job {job}"));
        Ok(JobRow {
            sequence: row.get("sequence")?,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            kind: JobKind::parse(&row.get::<String>("kind")?).ok_or_else(|| damaged("kind"))?,
            state: JobState::parse(&row.get::<String>("state")?).ok_or_else(|| damaged("state"))?,
            steps_total: from_sql(row.get("steps_total")?)?,
            steps_done: from_sql(row.get("steps_done")?)?,
            cancel_requested: row.get("cancel_requested")?,
            attempt: row.get("attempt")?,
            deaths: row.get("deaths")?,
            policy: row.get("policy")?,
            error: row.get("error")?,
            created_ms: row.get("created_ms")?,
            started_ms: row.get("started_ms")?,
            finished_ms: row.get("finished_ms")?,
            job,
        })
    }
}
