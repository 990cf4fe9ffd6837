//! The parts of an acknowledged answer to an observation that a replay reads.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::control::policy::advice::SpendingAdvice;
use crate::service::entries::notes::{self, PeriodNote};
use crate::service::entries::report::Report;
use crate::service::error::ServiceError;
use crate::service::sessions::advised::{AdvisedActions, AdvisedShares};
use crate::service::sessions::assets::{Composition, ObservedAssets};
use crate::service::sessions::content::answer;
use crate::service::sessions::session_state::SessionState;
use crate::store::EntryRow;

/// The numbers of the answer to an observation.
#[derive(Debug, Clone)]
pub(super) enum Acknowledged {
    Account(Box<AcknowledgedAccount>),
    Declared(Box<AcknowledgedProblem>),
}

/// The numbers for a session of an investor.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct AcknowledgedAccount {
    log_return: Option<f64>,
    advised_allocation: f64,
    executed_allocation: f64,
    advised_spending: Option<SpendingAdvice>,
    spent: Option<f64>,
    wealth: f64,
    assets: Option<ObservedAssets>,
    #[serde(default)]
    notes: Vec<PeriodNote>,
}

/// The numbers for a session of a declared problem.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct AcknowledgedProblem {
    noise: Option<f64>,
    advised: Option<BTreeMap<String, f64>>,
    executed: BTreeMap<String, f64>,
    state: BTreeMap<String, f64>,
}

impl Acknowledged {
    /// Reads the answer of an entry of the session that began in the state `start`.
    ///
    /// # Errors
    /// It is not such an answer.
    pub(super) fn of(start: &SessionState, entry: &EntryRow, names: &[String]) -> Result<Self, ServiceError> {
        Ok(match start {
            SessionState::Account(_) => Acknowledged::Account(answer(entry, names)?),
            SessionState::Declared(_) => Acknowledged::Declared(answer(entry, names)?),
        })
    }

    /// Returns the report with the acknowledged numbers, so that a replay on another processor or library agrees with
    /// them.
    pub(super) fn report(&self, reported: &Report) -> Report {
        match self {
            Acknowledged::Account(account) => account.report(reported),
            Acknowledged::Declared(problem) => Report {
                noise: problem.noise,
                missing: problem.noise.is_none(),
                executed: Some(problem.executed.clone()),
                state: Some(problem.state.clone()),
                date: reported.date,
                ..Report::recorded()
            },
        }
    }

    /// Returns the report. Several assets or actions that were executed as advised get what was advised as executed.
    pub(super) fn held_as_advised(&self, reported: &Report) -> Report {
        let mut report = reported.clone();
        match self {
            Acknowledged::Account(account) => {
                if let Some(assets) = &account.assets {
                    report.executed_allocations.get_or_insert_with(|| assets.advised_allocations.clone());
                }
            }
            Acknowledged::Declared(problem) => {
                if let (None, Some(advised)) = (&report.executed, &problem.advised) {
                    report = report.with_acknowledged(advised);
                }
            }
        }
        report
    }

    /// Returns what was advised.
    pub(super) fn advised(&self) -> AdvisedActions {
        match self {
            Acknowledged::Account(account) => AdvisedActions::Shares(AdvisedShares {
                held: account.advised_allocation,
                spent: SpendingAdvice::share_of(account.advised_spending),
            }),
            Acknowledged::Declared(problem) => {
                AdvisedActions::Actions(problem.advised.iter().flat_map(BTreeMap::values).copied().collect())
            }
        }
    }

    /// Returns the acknowledged composition if there are several assets.
    pub(super) fn composed(&self) -> Option<&Composition> {
        match self {
            Acknowledged::Account(account) => account.assets.as_ref().map(|assets| &assets.composed),
            Acknowledged::Declared(_) => None,
        }
    }
}

impl AcknowledgedAccount {
    fn report(&self, reported: &Report) -> Report {
        let Report { date, rate, flow, .. } = *reported;
        let spent = Some(self.spent.unwrap_or_default());
        let common = Report { wealth: Some(self.wealth), date, rate, flow, spent, ..Report::recorded() };
        let of_lost = |asset| notes::is_lost(&self.notes, asset).then_some(f64::NEG_INFINITY);
        match &self.assets {
            Some(assets) => Report {
                log_returns: assets.log_returns.as_ref().map(|all| {
                    all.iter().map(|(name, seen)| (name.clone(), seen.or_else(|| of_lost(Some(name))))).collect()
                }),
                missing: assets.log_returns.is_none(),
                executed_allocations: Some(assets.executed_allocations.clone()),
                ..common
            },
            None => {
                let log_return = self.log_return.or_else(|| of_lost(None));
                let executed_allocation = Some(self.executed_allocation);
                Report { log_return, missing: log_return.is_none(), executed_allocation, ..common }
            }
        }
    }
}
