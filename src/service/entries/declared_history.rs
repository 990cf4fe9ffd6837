//! The history of a session that lives a declared problem.

use std::collections::BTreeMap;

use jiff::civil::Date;
use serde::Serialize;
use utoipa::ToSchema;

use crate::service::entries::answer::{DeclaredCorrected, DeclaredObserved};
use crate::service::entries::periods::{Periods, ReplayedPeriod, SessionPeriod};
use crate::service::entries::report::{Correct, Report};
use crate::service::error::ServiceError;
use crate::service::sessions::content::{answer, content};
use crate::service::sessions::plan::DeclaredRenewed;
use crate::service::sessions::problem_state::ProblemState;
use crate::service::sessions::session_state::{Moved, SessionState};
use crate::store::{EntryKind, EntryRow, SessionFacts};

/// The start of a declared problem's session, and everything recorded since.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeclaredHistory {
    pub session: String,
    pub policy: String,
    /// States at the start, by name.
    pub initial_state: BTreeMap<String, f64>,
    /// Noises known at the start.
    pub history: Vec<f64>,
    pub observations: Vec<DeclaredObservation>,
    pub corrections: Vec<DeclaredCorrection>,
    /// The policies that followed the first.
    pub renewals: Vec<DeclaredRenewal>,
}

/// One renewal of a declared problem's session, as it was made.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeclaredRenewal {
    /// The answer to it.
    #[serde(flatten)]
    pub answered: DeclaredRenewed,
    pub renewed_ms: i64,
}

/// One period of a declared problem, observed or inserted later.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeclaredObservation {
    /// Its present number.
    pub period: usize,
    /// The answer when it was reported, with the number that it had then; null if a correction inserted it.
    pub answered: Option<DeclaredObserved>,
    /// The first report of it.
    pub reported: Report,
    pub observed_ms: i64,
    /// Numbers of the corrections that inserted it or reported it again.
    pub corrections: Vec<usize>,
    /// The period after all corrections.
    pub now: DeclaredNow,
}

/// A period of a declared problem after all corrections.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeclaredNow {
    /// Null if it is missing.
    pub noise: Option<f64>,
    /// The actions executed, by name.
    pub executed: BTreeMap<String, f64>,
    /// The reward of the period by the problem's formula; null if the noise is missing or the formula gives no number.
    pub reward: Option<f64>,
    /// Rewards since the start of the session, discounted to it.
    pub earned: f64,
    /// The states after the period, by name.
    pub state: BTreeMap<String, f64>,
    /// Its last day, if it is known.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
}

/// One correction of a declared problem's session, as it was made.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeclaredCorrection {
    #[serde(flatten)]
    pub correction: Correct,
    /// The answer to it.
    pub answer: DeclaredCorrected,
    pub corrected_ms: i64,
}

impl DeclaredHistory {
    /// Reads the history of a session that began in the state `start`.
    ///
    /// # Errors
    /// A recorded report no longer keeps the rules.
    pub(super) fn of(facts: &SessionFacts, periods: &Periods, start: &ProblemState) -> Result<Self, ServiceError> {
        let mut passage = periods.passage()?;
        let mut observations = Vec::with_capacity(periods.all.len());
        for (index, period) in periods.all.iter().enumerate() {
            let Some(passed) = passage.next().map_err(ServiceError::of_recorded)? else { break };
            let entry = &facts.entries[period.entry];
            observations.push(observation(index + 1, (period, entry), &passed, &passage.standing)?);
        }
        let made = facts.entries.iter().filter(|entry| entry.kind == EntryKind::Correction);
        let corrections = made.map(|entry| {
            let (correction, answer) = (content(entry, &[])?, answer(entry, &[])?);
            Ok(DeclaredCorrection { correction, answer, corrected_ms: entry.created_ms })
        });
        let renewed = facts.entries.iter().filter(|entry| entry.kind == EntryKind::Renewal);
        let renewals = renewed.map(|entry| {
            let answered = answer(entry, &[])?;
            Ok(DeclaredRenewal { answered, renewed_ms: entry.created_ms })
        });
        Ok(DeclaredHistory {
            session: facts.row.session.clone(),
            policy: facts.row.policy.clone(),
            initial_state: start.named(),
            history: facts.row.initial_history.clone(),
            observations,
            corrections: corrections.collect::<Result<_, ServiceError>>()?,
            renewals: renewals.collect::<Result<_, ServiceError>>()?,
        })
    }
}

/// Returns a period with this number, which leads to the state `after`.
fn observation(
    number: usize,
    (period, entry): (&SessionPeriod, &EntryRow),
    passed: &ReplayedPeriod,
    after: &SessionState,
) -> Result<DeclaredObservation, ServiceError> {
    let (Moved::Declared(moved), SessionState::Declared(after)) = (&passed.moved, after) else {
        return Err(ServiceError::internal("a period of another problem than its session"));
    };
    let (answered, reported) = match period.is_inserted() {
        true => (None, content::<Correct>(entry, &[])?.report()),
        false => (Some(answer(entry, &[])?), content(entry, &[])?),
    };
    Ok(DeclaredObservation {
        period: number,
        answered,
        reported,
        observed_ms: entry.created_ms,
        corrections: period.corrections.clone(),
        now: DeclaredNow {
            noise: moved.noise,
            executed: after.actions_named(&moved.actions),
            reward: moved.reward,
            earned: after.state.earned,
            state: after.named(),
            date: after.days.last,
        },
    })
}
