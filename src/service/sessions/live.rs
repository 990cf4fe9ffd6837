//! One live session in memory.

use std::sync::Arc;

use jiff::civil::Date;

use crate::service::entries::answer::{ObservationAnswer, ReportedPeriod};
use crate::service::entries::doubts::{self, Doubt, Doubts};
use crate::service::entries::periods::Periods;
use crate::service::entries::report::{Observe, Report};
use crate::service::error::ServiceError;
use crate::service::sessions::advised::{AdvisedActions, AdvisedShares};
use crate::service::sessions::asset_change::AssetNames;
use crate::service::sessions::current_advice::{AdviceContext, CurrentAdvice, with_uncertainty};
use crate::service::sessions::plan::{PolicyTenure, Renewing, SessionPlan};
use crate::service::sessions::session_state::{Moved, SessionState};
use crate::service::sessions::transition::Transition;
use crate::store::{RowVersion, SessionFacts, SessionRow};

/// A session replayed from its entries. It holds no policy: its advisor is cached under its name and may be dropped.
#[derive(Clone)]
pub struct LiveSession {
    pub row: Arc<SessionRow>,
    /// The names of several assets, entry by entry.
    pub(in crate::service) names: AssetNames,
    pub standing: SessionState,
    /// Periods observed.
    pub observed: usize,
    /// Corrections of these periods.
    pub corrections: usize,
    /// Policies that followed the first.
    pub renewals: usize,
    /// The policy that advises the coming period.
    pub current: Arc<PolicyTenure>,
    /// How the session renews itself.
    pub renew: Option<Renewing>,
    /// The rows it was replayed from.
    pub(in crate::service) seen: RowVersion,
    /// Radius of the state, once computed.
    pub(in crate::service) radius: Option<f64>,
    /// The advice for the coming period, once computed.
    pub(in crate::service) advice: Option<CurrentAdvice>,
}

/// Bytes of a session in memory, and of each of its returns: in the law with its weight, and in the history.
pub(super) const SESSION_BYTES: usize = 3000;
const RETURN_BYTES: usize = 24;

impl LiveSession {
    /// Replays a session from its entries.
    pub(in crate::service) fn replayed(facts: SessionFacts) -> Result<LiveSession, ServiceError> {
        let periods = Periods::of(&facts)?;
        let standing = periods.replay()?.standing;
        let SessionFacts { row, seen, .. } = facts;
        Ok(LiveSession {
            renew: SessionPlan::of(&row)?.renew,
            row: Arc::new(row),
            names: periods.names.clone(),
            standing,
            observed: periods.all.len(),
            corrections: periods.corrections,
            renewals: periods.renewals(),
            current: Arc::new(periods.current().clone()),
            seen,
            radius: None,
            advice: None,
        })
    }

    pub(in crate::service) fn bytes(&self) -> usize {
        SESSION_BYTES + RETURN_BYTES * self.standing.noises() + self.standing.other_bytes()
    }

    /// Checks that the session may report another period.
    ///
    /// # Errors
    /// Every period of the horizon is observed.
    pub(in crate::service) fn check_active(&self) -> Result<(), ServiceError> {
        let horizon = self.last_period();
        if self.observed < horizon {
            return Ok(());
        }
        Err(ServiceError::Completed { session: self.row.session.clone(), horizon })
    }

    /// Returns the last period that its policy advises.
    pub fn horizon(&self) -> usize {
        self.current.horizon()
    }

    /// Returns whether the next policy is to be trained. Until it is there, the session goes on with the present one.
    pub fn is_due(&self) -> bool {
        self.is_due_after(self.observed)
    }

    fn is_due_after(&self, observed: usize) -> bool {
        self.current.is_due(observed, self.renew, self.renewals)
    }

    /// Returns whether the session is advised for a period after `observed` ones.
    fn goes_on_after(&self, observed: usize) -> bool {
        observed < self.horizon() || self.is_due_after(observed)
    }

    /// Returns the last period that may be reported. A session that waits for its next policy may report one more
    /// horizon.
    pub(in crate::service) fn last_period(&self) -> usize {
        self.horizon() + if self.is_due() { self.current.terms.horizon } else { 0 }
    }

    /// Returns the step of its policy that advises the coming period.
    pub(in crate::service) fn step(&self) -> usize {
        self.current.step(self.observed)
    }

    /// Returns the step that advises the period after the coming one, if there is one.
    pub(in crate::service) fn following(&self) -> Option<usize> {
        let observed = self.observed + 1;
        self.goes_on_after(observed).then(|| self.current.step(observed))
    }

    /// Returns the last day of the coming period, if it is known.
    pub fn next_day(&self) -> Option<Date> {
        self.standing.days().next(self.current.terms.periods_per_year).filter(|_| self.goes_on_after(self.observed))
    }

    /// Checks the report and its doubts.
    ///
    /// # Errors
    /// The report breaks a rule, or it is doubted and comes without `confirm`.
    fn check_meant(&self, observe: &Observe, report: &Report, today: Date) -> Result<(), ServiceError> {
        let seen = self.standing.read(report)?;
        if observe.confirm {
            return Ok(());
        }
        let of_day = doubts::of_day(self.standing.days(), report.date, self.current.terms.periods_per_year, today);
        let of_noise = self.standing.noise_doubts(report, &seen);
        let doubts: Vec<Doubt> =
            of_day.into_iter().chain(of_noise).chain(observe.peer_doubts.iter().cloned()).collect();
        if doubts.is_empty() { Ok(()) } else { Err(ServiceError::Unconfirmed(Doubts(doubts))) }
    }

    pub(in crate::service) fn check_next_period(&self, period: usize) -> Result<(), ServiceError> {
        let horizon = self.last_period();
        if self.observed >= horizon {
            return Err(ServiceError::PastHorizon { given: period, horizon });
        }
        let expected = self.observed + 1;
        if period == expected { Ok(()) } else { Err(ServiceError::Gap { what: "period", given: period, expected }) }
    }

    /// Returns the advice for the coming period, computed once, as [`AdviceContext::advise`] does.
    pub(in crate::service) async fn current_advice(
        &mut self,
        means: &AdviceContext<'_>,
    ) -> Result<&CurrentAdvice, ServiceError> {
        let advice = match self.advice.take() {
            Some(advice) => advice,
            None => means.advise(&self.row.tenant, (&self.standing, self.radius), self.step()).await?,
        };
        Ok(self.advice.insert(advice))
    }

    /// Returns the state after the report and the answer to it. Nothing changes yet but the memoised advice.
    pub(in crate::service) async fn after(
        &mut self,
        observe: &Observe,
        report: &Report,
        (means, today): (&AdviceContext<'_>, Date),
    ) -> Result<(SessionState, ObservationAnswer), ServiceError> {
        self.check_meant(observe, report, today)?;
        let is_account = self.standing.account().is_ok();
        let advice = match self.current_advice(means).await {
            Ok(advice) => Some(advice.clone()),
            // What was done is a fact even if nothing can be advised.
            Err(ServiceError::Field(_)) if !is_account => None,
            Err(error) => return Err(error),
        };
        let advised = match &advice {
            Some(CurrentAdvice::Account(advice)) => AdvisedActions::Shares(AdvisedShares::of(advice)),
            Some(CurrentAdvice::Declared(decided)) => {
                AdvisedActions::Actions(decided.actions.values().copied().collect())
            }
            None => AdvisedActions::Actions(Vec::new()),
        };
        let Transition { seen, moved, standing } =
            self.standing.after((&self.current, self.observed), report, &advised)?;
        let completed = !self.goes_on_after(observe.period);
        let next = self.current.step_from(observe.period, self.renew, self.renewals);
        let (standing, uncertainty) = with_uncertainty(means, &self.row.tenant, next, standing).await?;
        let about = ReportedPeriod { session: observe.session.clone(), period: observe.period, completed, uncertainty };
        let answer = match (&self.standing, &standing, &moved, advice) {
            (
                SessionState::Account(before),
                SessionState::Account(after),
                Moved::Account(moved),
                Some(CurrentAdvice::Account(advice)),
            ) => ObservationAnswer::Account(after.observed(before, (&seen, moved), &advice, about).into()),
            (_, SessionState::Declared(after), Moved::Declared(moved), advice) => {
                let advised = advice.and_then(CurrentAdvice::actions);
                ObservationAnswer::Declared(after.observed(moved, advised, about).into())
            }
            _ => return Err(ServiceError::internal("a period of another problem than its session")),
        };
        Ok((standing, answer))
    }
}
