//! How answers to observations and corrections show the state that they lead to.

use std::collections::BTreeMap;

use crate::control::assets::advice::named;
use crate::control::policy::advice::{Advice, Uncertainty};
use crate::service::entries::answer::{Corrected, DeclaredCorrected, DeclaredObserved, Observed, ReportedPeriod};
use crate::service::entries::notes;
use crate::service::entries::record::PeriodNoise;
use crate::service::entries::report::Correct;
use crate::service::sessions::account_state::{AccountPeriod, AccountState};
use crate::service::sessions::assets::ObservedAssets;
use crate::service::sessions::problem_state::{ProblemPeriod, ProblemState};

impl AccountState {
    /// Returns the answer to the report of a period that led here.
    pub(in crate::service) fn observed(
        &self,
        before: &AccountState,
        (seen, moved): (&PeriodNoise, &AccountPeriod),
        advice: &Advice,
        about: ReportedPeriod,
    ) -> Observed {
        let ReportedPeriod { session, period, completed, uncertainty } = about;
        let advised = before.assets.as_ref().map(|assets| assets.shares(advice.allocation)).unwrap_or_default();
        Observed {
            session,
            period,
            log_return: moved.log_return,
            notes: notes::of(seen, self.names()),
            band: advice.band,
            advised_allocation: advice.allocation,
            executed_allocation: moved.executed_allocation,
            advised_spending: advice.spending,
            spent: moved.reported_spending(),
            wealth: self.state.wealth,
            holding: self.state.holding,
            assets: self.assets.as_ref().map(|assets| ObservedAssets {
                log_returns: assets.shown(seen),
                advised_allocations: named(&assets.names, &advised),
                executed_allocations: named(&assets.names, &moved.executed),
                composed: assets.composed(),
            }),
            wealth_change: self.state.wealth - before.state.wealth,
            date: self.days.last,
            completed,
            drift: self.bet.drift(),
            uncertainty,
        }
    }

    /// Returns the answer to a correction that led here; `before_last` is the state before the last period.
    pub(in crate::service) fn corrected(
        &self,
        (session, correct): (&str, &Correct),
        observed: usize,
        (now, before_last): (Option<&AccountPeriod>, &AccountState),
        uncertainty: Uncertainty,
    ) -> Corrected {
        Corrected {
            session: session.to_owned(),
            correction: correct.correction,
            period: correct.period,
            log_return: now.and_then(|now| now.log_return),
            observed,
            wealth: self.state.wealth,
            holding: self.state.holding,
            assets: self.assets.as_ref().map(|assets| assets.composed()),
            wealth_change: self.state.wealth - before_last.state.wealth,
            date: self.days.last,
            drift: self.bet.drift(),
            uncertainty,
        }
    }
}

impl ProblemState {
    /// Returns the answer to the report of a period that led here, for which these actions were advised.
    pub(in crate::service) fn observed(
        &self,
        moved: &ProblemPeriod,
        advised: Option<BTreeMap<String, f64>>,
        about: ReportedPeriod,
    ) -> DeclaredObserved {
        let ReportedPeriod { session, period, completed, uncertainty } = about;
        DeclaredObserved {
            session,
            period,
            noise: moved.noise,
            advised,
            executed: self.actions_named(&moved.actions),
            reward: moved.reward,
            earned: self.state.earned,
            state: self.named(),
            date: self.days.last,
            completed,
            drift: self.bet.drift(),
            uncertainty,
        }
    }

    /// Returns the answer to a correction that led here.
    pub(in crate::service) fn corrected(
        &self,
        (session, correct): (&str, &Correct),
        observed: usize,
        noise: Option<f64>,
        uncertainty: Uncertainty,
    ) -> DeclaredCorrected {
        DeclaredCorrected {
            session: session.to_owned(),
            correction: correct.correction,
            period: correct.period,
            noise,
            observed,
            earned: self.state.earned,
            state: self.named(),
            date: self.days.last,
            drift: self.bet.drift(),
            uncertainty,
        }
    }
}
