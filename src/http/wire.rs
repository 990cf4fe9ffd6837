//! Requests and answers as they travel.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::policy::advice::Advice;
use crate::control::policy::caution::Caution;
use crate::control::policy::sensitivity::{Sensitivity, cautions};
use crate::control::policy::worst_case::WorstCase;
use crate::control::problem::actions::Band;
use crate::control::progress::Phase;
use crate::control::request::framework::Framework;
use crate::control::request::specification::Specification;
use crate::control::solved_step::StepDiagnostics;
use crate::service::action::Action as ServiceAction;
use crate::service::error::ServiceError;
use crate::service::jobs::Job as ServiceJob;
use crate::service::live::Live;
use crate::service::observation::Observed;
use crate::store::{JobKind, JobState, ObservationRow, PolicySummary, SessionSummary};

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub struct Job {
    pub job: String,
    pub kind: JobKind,
    pub state: JobState,
    /// A cancel was asked for; the worker stops within a second.
    pub cancel_requested: bool,
    pub progress: JobProgress,
    /// The policy of a succeeded training.
    pub policy: Option<String>,
    /// Where the report of a succeeded evaluation is.
    pub report: Option<String>,
    /// Why it failed.
    pub error: Option<String>,
    pub created_ms: i64,
    pub started_ms: Option<i64>,
    pub finished_ms: Option<i64>,
}

/// How far a job is.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobProgress {
    pub steps_done: usize,
    pub steps_total: usize,
    /// The step being solved; steps are solved from the last to the first. Null in a simulation.
    pub step: Option<usize>,
    pub phase: Option<Phase>,
    /// Design points solved, or paths simulated, in this step.
    pub points_done: Option<usize>,
    pub points_total: Option<usize>,
    pub seconds_left: Option<f64>,
}

impl From<ServiceJob> for Job {
    fn from(ServiceJob { row, progress }: ServiceJob) -> Self {
        let current = progress.and_then(|progress| progress.current);
        Job {
            progress: JobProgress {
                steps_done: progress.map_or(row.steps_done, |progress| progress.steps_done.max(row.steps_done)),
                steps_total: row.steps_total,
                step: current.filter(|current| current.phase != Phase::Simulating).map(|current| current.step),
                phase: current.map(|current| current.phase),
                points_done: current.map(|current| current.done),
                points_total: current.map(|current| current.total),
                seconds_left: progress.and_then(|progress| progress.seconds_left),
            },
            report: (row.kind == JobKind::Evaluate && row.state == JobState::Succeeded)
                .then(|| format!("/jobs/{}/report", row.job)),
            job: row.job,
            kind: row.kind,
            state: row.state,
            cancel_requested: row.cancel_requested,
            policy: row.policy,
            error: row.error,
            created_ms: row.created_ms,
            started_ms: row.started_ms,
            finished_ms: row.finished_ms,
        }
    }
}

/// A page of jobs, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobPage {
    pub jobs: Vec<Job>,
    /// Give it as `after` for the next page; null on the last.
    pub next: Option<i64>,
}

/// A policy in a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct PolicyEntry {
    pub policy: String,
    pub created_ms: i64,
    /// Length of the exported document.
    pub bytes: u64,
}

impl From<PolicySummary> for PolicyEntry {
    fn from(row: PolicySummary) -> Self {
        PolicyEntry { policy: row.policy, created_ms: row.created_ms, bytes: row.bytes }
    }
}

/// A page of policies, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct PolicyPage {
    pub policies: Vec<PolicyEntry>,
    /// Give it as `after` for the next page; null on the last.
    pub next: Option<i64>,
}

/// A policy, and how well each of its steps was solved.
#[derive(Debug, Serialize, ToSchema)]
pub struct PolicyDetail {
    pub policy: String,
    pub created_ms: i64,
    pub framework: Framework,
    pub horizon: usize,
    pub specification: Specification,
    pub diagnostics: Vec<StepDiagnostics>,
}

/// An imported policy.
#[derive(Debug, Serialize, ToSchema)]
pub struct Imported {
    pub policy: String,
}

/// A session to open.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct OpenSession {
    /// The policy to live by.
    pub policy: String,
    /// Log-returns known at the start. Default: the policy's.
    pub history: Option<Vec<f64>>,
    /// Default: the policy's initial wealth.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset at the start. Default: 0.
    pub holding: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionState {
    Active,
    /// The horizon is reached.
    Completed,
}

/// A live investor.
#[derive(Debug, Serialize, ToSchema)]
pub struct Session {
    pub session: String,
    pub policy: String,
    /// The coming period, from 1; `horizon + 1` once completed.
    pub period: usize,
    pub horizon: usize,
    pub state: SessionState,
    pub wealth: f64,
    /// Share of wealth in the risky asset, before trading.
    pub holding: f64,
    pub sample_size: usize,
    pub created_ms: i64,
}

fn session_state(observed: usize, horizon: usize) -> SessionState {
    if observed >= horizon { SessionState::Completed } else { SessionState::Active }
}

impl From<Live> for Session {
    fn from(live: Live) -> Self {
        Session {
            period: live.observed() + 1,
            state: session_state(live.observed(), live.row.horizon),
            wealth: live.state.wealth,
            holding: live.state.holding,
            sample_size: live.state.law.sample_size(),
            session: live.row.session.clone(),
            policy: live.row.policy.clone(),
            horizon: live.row.horizon,
            created_ms: live.row.created_ms,
        }
    }
}

/// A session in a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct SessionEntry {
    pub session: String,
    pub policy: String,
    pub period: usize,
    pub horizon: usize,
    pub state: SessionState,
    pub initial_wealth: f64,
    pub created_ms: i64,
}

impl From<SessionSummary> for SessionEntry {
    fn from(row: SessionSummary) -> Self {
        SessionEntry {
            period: row.observations + 1,
            state: session_state(row.observations, row.horizon),
            session: row.session,
            policy: row.policy,
            horizon: row.horizon,
            initial_wealth: row.initial_wealth,
            created_ms: row.created_ms,
        }
    }
}

/// A page of sessions, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct SessionPage {
    pub sessions: Vec<SessionEntry>,
    /// Give it as `after` for the next page; null on the last.
    pub next: Option<i64>,
}

/// Where a session started and everything it observed.
#[derive(Debug, Serialize, ToSchema)]
pub struct SessionHistory {
    pub session: String,
    pub policy: String,
    pub initial_wealth: f64,
    /// Share of it in the risky asset.
    pub initial_holding: f64,
    /// Log-returns known at the start.
    pub history: Vec<f64>,
    pub observations: Vec<Observation>,
}

/// One observed period.
#[derive(Debug, Serialize, ToSchema)]
pub struct Observation {
    pub period: usize,
    pub log_return: f64,
    /// The holdings that were best kept at the start of the period.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    pub advised_allocation: f64,
    pub executed_allocation: f64,
    /// Wealth at the end of the period.
    pub wealth: f64,
    /// Share of it in the risky asset, as the return left it.
    pub holding: f64,
    /// Radius of the uncertainty set after the period, in the unit of an advice's.
    pub radius: f64,
    pub observed_ms: i64,
}

impl TryFrom<ObservationRow> for Observation {
    type Error = ServiceError;

    fn try_from(row: ObservationRow) -> Result<Self, ServiceError> {
        let answer: Observed = serde_json::from_str(&row.answer_json).map_err(ServiceError::internal)?;
        Ok(Observation {
            period: row.period,
            log_return: row.log_return,
            band: answer.band,
            advised_allocation: row.advised_allocation,
            executed_allocation: row.executed_allocation,
            wealth: row.wealth_after,
            holding: answer.holding,
            radius: answer.uncertainty.radius,
            observed_ms: row.created_ms,
        })
    }
}

/// The robust allocation for the coming period.
#[derive(Debug, Serialize, ToSchema)]
pub struct Action {
    pub session: String,
    pub period: usize,
    #[serde(flatten)]
    pub advice: Advice,
    /// The law that is worst for this allocation, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// What to know before the advice is followed.
    pub caution: Vec<Caution>,
    /// How near it is to changing, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Sensitivity>,
}

impl Action {
    pub fn new(session: String, action: ServiceAction) -> Self {
        let ServiceAction { period, advice, worst_case, sensitivity } = action;
        let caution = cautions(&advice, sensitivity.as_ref());
        Action { session, period, advice, worst_case, caution, sensitivity }
    }
}
