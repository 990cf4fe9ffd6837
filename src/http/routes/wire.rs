//! Requests and answers as they are sent.

use std::collections::BTreeMap;

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::evaluation::assets::report::AssetsBacktestReport;
use crate::control::evaluation::backtest_report::BacktestReport;
use crate::control::evaluation::declared_comparison::ComparisonReport;
use crate::control::evaluation::declared_walk::DeclaredWalkReport;
use crate::control::evaluation::frontier::report::FrontierReport;
use crate::control::evaluation::report::EvaluationReport;
use crate::control::posed::Posed;
use crate::control::progress::Phase;
use crate::control::request::annualised::Annualised;
use crate::control::request::by_name::distinct_if_given;
use crate::control::request::framework::Framework;
use crate::control::request::warnings::Warning;
use crate::control::solved_step::StepDiagnostics;
use crate::service::entries::drift::Drift;
use crate::service::jobs::renewer::RenewalDue;
use crate::service::jobs::{Accepted, TrackedJob as ServiceJob};
use crate::service::sessions::assets::Composition;
use crate::service::sessions::initial_history::InitialHistory;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::plan::Renewing;
use crate::service::sessions::session_state::SessionState;
use crate::store::{JobKind, JobState, Labels, PolicySummary};

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub struct Job {
    pub job: String,
    pub kind: JobKind,
    pub state: JobState,
    /// True if a cancel was requested; the worker stops within a second.
    pub cancel_requested: bool,
    pub progress: JobProgress,
    /// Policy of a succeeded training.
    pub policy: Option<String>,
    /// Address of the report of a succeeded evaluation, walk-forward backtest or frontier.
    pub report: Option<String>,
    /// Reason for the failure.
    pub error: Option<String>,
    pub created_ms: i64,
    pub started_ms: Option<i64>,
    pub finished_ms: Option<i64>,
}

/// The progress of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobProgress {
    pub steps_done: usize,
    pub steps_total: usize,
    /// Step being solved; steps are solved from the last to the first. Null in a simulation.
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
            report: (row.kind != JobKind::Train && row.state == JobState::Succeeded)
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

/// A job that was accepted.
#[derive(Debug, Serialize, ToSchema)]
pub struct AcceptedJob {
    #[serde(flatten)]
    pub job: Job,
    /// Valid entries of the request that may be mistakes.
    pub warnings: Vec<Warning>,
}

impl From<Accepted> for AcceptedJob {
    fn from(Accepted { job, warnings }: Accepted) -> Self {
        AcceptedJob { job: job.into(), warnings }
    }
}

/// The report of a job: of an evaluation, of a walk-forward backtest or of a frontier.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "reports are sent as they are stored; this type only describes them")]
pub enum JobReport {
    Evaluation(Box<EvaluationReport>),
    Comparison(Box<ComparisonReport>),
    Backtest(Box<BacktestReport>),
    BacktestOfAssets(Box<AssetsBacktestReport>),
    BacktestOfDeclared(Box<DeclaredWalkReport>),
    Frontier(Box<FrontierReport>),
}

/// A page of jobs, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobPage {
    pub jobs: Vec<Job>,
    /// Cursor to pass as `after` for the next page; null on the last page.
    pub next: Option<i64>,
}

/// A policy in a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct PolicyEntry {
    pub policy: String,
    pub created_ms: i64,
    /// Length of the exported document, in bytes.
    pub bytes: u64,
    #[serde(flatten)]
    pub labels: Labels,
}

impl From<PolicySummary> for PolicyEntry {
    fn from(row: PolicySummary) -> Self {
        PolicyEntry { policy: row.policy, created_ms: row.created_ms, bytes: row.bytes, labels: row.labels }
    }
}

/// A page of policies, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct PolicyPage {
    pub policies: Vec<PolicyEntry>,
    /// Cursor to pass as `after` for the next page; null on the last page.
    pub next: Option<i64>,
}

/// A policy, and how well each of its steps was solved.
#[derive(Debug, Serialize, ToSchema)]
pub struct PolicyDetail {
    pub policy: String,
    #[serde(flatten)]
    pub labels: Labels,
    pub created_ms: i64,
    pub framework: Framework,
    pub horizon: usize,
    pub specification: Posed,
    /// Annual figures; present if `problem.periods_per_year` was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub annualised: Option<Annualised>,
    /// Valid entries of the specification that may be mistakes.
    pub warnings: Vec<Warning>,
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
    /// The policy to use.
    pub policy: String,
    /// Log-returns known at the start; for several assets, date by date. Default: those of the policy.
    pub history: Option<InitialHistory>,
    /// Wealth at the start. Default: the policy's initial wealth.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset at the start. Default: 0.
    pub holding: Option<f64>,
    /// Share of wealth in each of several assets at the start, by name. Default: 0.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub holdings: Option<BTreeMap<String, f64>>,
    /// States of a declared problem at the start, by name. Default: the problem's own start.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub state: Option<BTreeMap<String, f64>>,
    /// Automatic renewal: the next policy is trained on the returns seen, and the session continues with it. Default:
    /// never.
    pub renew: Option<Renewing>,
    /// If true, the first step of a policy with decaying learning advises every period, for up to 5200 periods.
    /// Default: false.
    #[serde(default)]
    pub rolling: bool,
    /// Name of the session, at most 100 letters.
    pub name: Option<String>,
    /// Notes, at most 2,000 letters.
    pub notes: Option<String>,
    /// Tags: at most 20, all different, of 1 to 50 letters each.
    pub tags: Option<Vec<String>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionStatus {
    Active,
    /// The next policy is to be trained; until it is ready the session uses its present one.
    Waiting,
    /// The horizon is reached, and no policy follows.
    Completed,
}

/// A live session: an investor's, or one of a declared problem.
#[derive(Debug, Serialize, ToSchema)]
pub struct Session {
    pub session: String,
    #[serde(flatten)]
    pub labels: Labels,
    /// The policy that advises the coming period.
    pub policy: String,
    /// The coming period, from 1; `horizon + 1` once completed.
    pub period: usize,
    /// The last period that the policy advises.
    pub horizon: usize,
    pub state: SessionStatus,
    /// Last day of the last period: as reported, and otherwise the next one due after the periods before it. Null if no
    /// day is known.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// Last day of the coming period, by the policy's periods a year, and otherwise by the days reported. A report
    /// without a day gets this day. Null if this is not known, or the session is completed.
    #[schema(value_type = Option<String>, format = Date)]
    pub next: Option<Date>,
    /// Null if the session lives a declared problem.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset, before trading; for several assets, the share in all of them. Null if the
    /// session lives a declared problem.
    pub holding: Option<f64>,
    /// States of a declared problem before the coming period, by name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub states: Option<BTreeMap<String, f64>>,
    /// Rewards of a declared problem since the start of the session, discounted to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub earned: Option<f64>,
    /// Holdings of several assets, before the coming period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assets: Option<Composition>,
    pub sample_size: usize,
    /// Number of corrections; the next one has this number plus one.
    pub corrections: usize,
    /// Number of policies that followed the first; the next renewal has this number plus one.
    pub renewals: usize,
    /// Automatic renewal; null if there is none.
    pub renew: Option<Renewing>,
    /// True if the first step of the policy advises every period.
    pub rolling: bool,
    /// State of the next renewal; null if it is not due.
    pub renewal: Option<RenewalDue>,
    /// Evidence that the returns have changed.
    pub drift: Drift,
    pub created_ms: i64,
}

pub fn session_state(observed: usize, horizon: usize, is_due: bool) -> SessionStatus {
    match observed < horizon {
        _ if is_due => SessionStatus::Waiting,
        true => SessionStatus::Active,
        false => SessionStatus::Completed,
    }
}

impl From<LiveSession> for Session {
    fn from(live: LiveSession) -> Self {
        let (account, declared) = match &live.standing {
            SessionState::Account(account) => (Some(account), None),
            SessionState::Declared(declared) => (None, Some(declared)),
        };
        Session {
            period: live.observed + 1,
            state: session_state(live.observed, live.horizon(), live.is_due()),
            date: live.standing.days().last,
            next: live.next_day(),
            wealth: account.map(|account| account.state.wealth),
            holding: account.map(|account| account.state.holding),
            states: declared.map(|declared| declared.named()),
            earned: declared.map(|declared| declared.state.earned),
            assets: account.and_then(|account| account.assets.as_ref()).map(|assets| assets.composed()),
            sample_size: live.standing.sample_size(),
            corrections: live.corrections,
            drift: live.standing.bet().drift(),
            session: live.row.session.clone(),
            labels: Labels::default(),
            policy: live.current.policy.clone(),
            horizon: live.horizon(),
            renewals: live.renewals,
            renew: live.renew,
            rolling: live.current.is_rolling(),
            renewal: None,
            created_ms: live.row.created_ms,
        }
    }
}
