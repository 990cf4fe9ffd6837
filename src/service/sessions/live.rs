//! One live session in memory.

use std::sync::Arc;

use jiff::civil::Date;

use crate::control::assets::advice::named;
use crate::control::policy::advice::{Advice, Uncertainty};
use crate::control::policy::advisor::{Advisor, OutsideDesign};
use crate::control::problem::state::State;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::fair_queue::FairQueue;
use crate::service::entries::answer::Observed;
use crate::service::entries::doubts::{self, Doubt, Doubts};
use crate::service::entries::notes;
use crate::service::entries::periods::Periods;
use crate::service::entries::report::{Observe, Report};
use crate::service::error::ServiceError;
use crate::service::sessions::asset_change::AssetNames;
use crate::service::sessions::assets::{Assets, ObservedAssets};
use crate::service::sessions::plan::{PolicyTenure, Renewing, SessionPlan};
use crate::service::sessions::session_state::{SessionState, Transition};
use crate::store::{RowVersion, SessionFacts, SessionRow, Tenant};

/// The resources that a call needs: its policy, the queues for its work, and the permits it must acquire before it
/// solves.
pub(in crate::service) struct AdviceContext<'a> {
    pub advisor: Arc<Advisor>,
    pub advising: &'a FairQueue,
    pub resolving: &'a FairQueue,
    /// `None` for the service's own work.
    pub turn: Option<&'a HeavyPermit>,
}

impl AdviceContext<'_> {
    /// Acquires the permits for heavy work that comes next.
    async fn begin(&self) -> Result<(), ServiceError> {
        match self.turn {
            Some(turn) => Ok(turn.begin().await?),
            None => Ok(()),
        }
    }
}

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
    /// The surrogate's advice for the coming period, once computed.
    pub(in crate::service) advice: Option<Advice>,
}

/// Bytes of a session in memory, and of each of its returns: in the law with its weight, and in the history.
pub(super) const SESSION_BYTES: usize = 3000;
const RETURN_BYTES: usize = 24;
/// Copies of the asset names: in the order of the columns, in the plan, and in the answers.
const COPIES_OF_NAMES: usize = 8;

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
        let names =
            self.standing.assets.as_ref().map_or(0, |assets| assets.names.iter().map(String::len).sum::<usize>());
        SESSION_BYTES + RETURN_BYTES * self.standing.returns() + COPIES_OF_NAMES * names
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
    fn last_period(&self) -> usize {
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
        self.standing.days.next(self.current.terms.periods_per_year).filter(|_| self.goes_on_after(self.observed))
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
        let of_day = doubts::of_day(&self.standing.days, report.date, self.current.terms.periods_per_year, today);
        let of_return = self.standing.return_doubts(report, &seen);
        let doubts: Vec<Doubt> =
            of_day.into_iter().chain(of_return).chain(observe.peer_doubts.iter().cloned()).collect();
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

    /// Returns the surrogate's advice for the coming period, computed once. A short computation runs here, a longer one
    /// on a thread that may block. A state outside the design is solved, which is heavy work.
    pub(in crate::service) async fn surrogate_advice(
        &mut self,
        means: &AdviceContext<'_>,
    ) -> Result<&Advice, ServiceError> {
        let step = self.step();
        let advice = match self.advice.take() {
            Some(advice) => advice,
            None => match self.predicted(step, means).await? {
                Ok(advice) => advice,
                Err(outside) => {
                    means.begin().await?;
                    let (advisor, state) = (means.advisor.clone(), self.standing.state.clone());
                    let tenant = &self.row.tenant;
                    means.resolving.run(tenant, move || advisor.advise_outside(step, &state, &outside)).await?
                }
            },
        };
        Ok(self.advice.insert(advice))
    }

    /// Returns the surrogate's prediction for the state, unless the state lies outside the design.
    async fn predicted(
        &self,
        step: usize,
        means: &AdviceContext<'_>,
    ) -> Result<Result<Advice, OutsideDesign>, ServiceError> {
        let predict = move |advisor: &Advisor, state: &State, radius: Option<f64>| {
            let radius = radius.unwrap_or_else(|| advisor.radius(state));
            advisor.advise_from_surrogate(step, state, radius)
        };
        if means.advisor.is_prompt(step, &self.standing.state) {
            return Ok(predict(&means.advisor, &self.standing.state, self.radius));
        }
        let (advisor, state, radius) = (means.advisor.clone(), self.standing.state.clone(), self.radius);
        means.advising.run(&self.row.tenant, move || predict(&advisor, &state, radius)).await
    }

    /// Returns the state after the report and the answer to it. Nothing changes yet but the memoised advice.
    pub(in crate::service) async fn after(
        &mut self,
        observe: &Observe,
        report: &Report,
        (means, today): (&AdviceContext<'_>, Date),
    ) -> Result<(SessionState, Observed), ServiceError> {
        self.check_meant(observe, report, today)?;
        let Advice { allocation, band, .. } = *self.surrogate_advice(means).await?;
        let dynamics = self.current.dynamics(self.observed);
        let periods_per_year = self.current.terms.periods_per_year;
        let passed = self.standing.after(dynamics, observe.period, report, (allocation, periods_per_year))?;
        let Transition { seen, log_return, executed_allocation, executed, standing, .. } = passed;
        let advised = self.standing.assets.as_ref().map(|assets| assets.shares(allocation));
        let check_active = self.goes_on_after(observe.period);
        let next = self.current.step_from(observe.period, self.renew, self.renewals);
        let (standing, uncertainty) = with_uncertainty(means, &self.row.tenant, next, standing).await?;
        let answer = Observed {
            session: observe.session.clone(),
            period: observe.period,
            log_return,
            notes: notes::of(&seen, standing.names()),
            band,
            advised_allocation: allocation,
            executed_allocation,
            wealth: standing.state.wealth,
            holding: standing.state.holding,
            assets: standing.assets.as_ref().map(|assets| ObservedAssets {
                log_returns: assets.shown(&seen),
                advised_allocations: named(&assets.names, &advised.unwrap_or_default()),
                executed_allocations: named(&assets.names, &executed),
                composed: assets.composed(),
            }),
            wealth_change: standing.state.wealth - self.standing.state.wealth,
            date: standing.days.last,
            completed: !check_active,
            drift: standing.bet.drift(),
            uncertainty,
        };
        Ok((standing, answer))
    }
}

/// Returns the uncertainty set before `step` of the policy. For several assets the composition is chosen first, which
/// is heavy work if it needs a solve.
pub(in crate::service) async fn with_uncertainty(
    means: &AdviceContext<'_>,
    tenant: &Tenant,
    step: usize,
    mut standing: SessionState,
) -> Result<(SessionState, Uncertainty), ServiceError> {
    let advisor = &means.advisor;
    if standing.assets.is_none() && advisor.is_prompt(step, &standing.state) {
        let uncertainty = advisor.uncertainty(&standing.state);
        return Ok((standing, uncertainty));
    }
    let turns = match standing.assets.is_some() && Assets::must_solve(advisor, step) {
        true => {
            means.begin().await?;
            means.resolving
        }
        false => means.advising,
    };
    let advisor = advisor.clone();
    let measure = move || {
        standing.compose(&advisor, step);
        let (uncertainty, reached) = (advisor.uncertainty(&standing.state), standing.state.clone());
        // If this is the first session to get this far, the next advice finds its common random numbers simulated.
        ((standing, uncertainty), move || advisor.prepare(step, &reached))
    };
    turns.run_and_prepare(tenant, measure).await
}
