//! One live session in memory.

use std::sync::Arc;

use super::allowance::HeavyTurn;
use super::bounded::Bounded;
use super::error::ServiceError;
use super::observation::{Observe, Observed};
use crate::control::error::FieldError;
use crate::control::policy::advice::{Advice, Uncertainty};
use crate::control::policy::advisor::{Advisor, OutsideDesign};
use crate::control::problem::state::State;
use crate::control::request::rules as limits;
use crate::store::{Seen, SessionFacts, SessionRow};

/// By what a call is answered, where its work is done, and what it must take before it solves.
pub(super) struct Means<'a> {
    pub advisor: Arc<Advisor>,
    pub advising: &'a Bounded,
    pub resolving: &'a Bounded,
    pub turn: &'a HeavyTurn,
}

/// A session replayed from its rows. It holds no policy: what it is advised by is kept under its name, and may be dropped.
#[derive(Clone)]
pub struct Live {
    pub row: Arc<SessionRow>,
    pub state: State,
    /// The rows it was replayed from.
    pub(super) seen: Seen,
    /// Radius of the state, once computed.
    pub(super) radius: Option<f64>,
    /// Price reported for the last period.
    pub(super) price: Option<f64>,
    /// The surrogate's advice for the coming period, once computed.
    pub(super) advice: Option<Advice>,
}

/// Wealth as return, allocation and contributions give it.
fn reached(wealth: f64) -> Result<f64, FieldError> {
    let (low, high) = limits::WEALTH;
    if (low..=high).contains(&wealth) {
        return Ok(wealth);
    }
    let rule = format!(
        "must be reported: what the return, the allocation and the contributions give is {wealth}, and a wealth lies in [{low}, {high}]"
    );
    Err(FieldError::new("wealth", "null", rule))
}

/// Bytes of a session in memory, and of each of its returns, in the law and in the history.
pub(super) const SESSION_BYTES: usize = 3000;
const RETURN_BYTES: usize = 16;

impl Live {
    /// The session that its rows tell of.
    pub(super) fn replayed(facts: SessionFacts, advisor: &Advisor) -> Result<Live, ServiceError> {
        let SessionFacts { row, observations, seen } = facts;
        let start = advisor.initial_state(Some(&row.initial_history), Some(row.initial_wealth))?;
        let mut state = start.with_holding(row.initial_holding)?;
        for (step, observation) in observations.iter().enumerate() {
            state = advisor.advance(step, &state, observation.executed_allocation, observation.log_return);
            state.wealth = observation.wealth_after;
        }
        let last = observations.last().and_then(|row| serde_json::from_str::<Observed>(&row.answer_json).ok());
        let price = last.and_then(|answer| answer.price);
        Ok(Live { row: Arc::new(row), state, seen, price, radius: None, advice: None })
    }

    pub(super) fn bytes(&self) -> usize {
        SESSION_BYTES + RETURN_BYTES * self.state.law.sample_size()
    }

    /// Periods observed.
    pub fn observed(&self) -> usize {
        self.seen.observed()
    }

    /// The session after an observation that left `state`, whose radius is `radius`.
    pub(super) fn taken_to(&self, seen: Seen, state: State, price: Option<f64>, radius: f64) -> Live {
        Live { row: self.row.clone(), state, seen, price, radius: Some(radius), advice: None }
    }

    pub(super) fn expects(&self, period: usize) -> Result<(), ServiceError> {
        if self.observed() >= self.row.horizon {
            return Err(ServiceError::PastHorizon { given: period, horizon: self.row.horizon });
        }
        let expected = self.observed() + 1;
        if period == expected { Ok(()) } else { Err(ServiceError::PeriodGap { given: period, expected }) }
    }

    /// The surrogate's advice for the coming period, computed once: here where that takes less than a thread would, else
    /// on a thread that may block. A state outside the design is solved, which is heavy from there on.
    pub(super) async fn surrogate_advice(&mut self, means: &Means<'_>) -> Result<&Advice, ServiceError> {
        let step = self.observed();
        let advice = match self.advice.take() {
            Some(advice) => advice,
            None => match self.predicted(step, means).await? {
                Ok(advice) => advice,
                Err(outside) => {
                    means.turn.begin()?;
                    let (advisor, state) = (means.advisor.clone(), self.state.clone());
                    let tenant = &self.row.tenant;
                    means.resolving.run(tenant, move || advisor.advise_outside(step, &state, &outside)).await?
                }
            },
        };
        Ok(self.advice.insert(advice))
    }

    /// What the surrogate says of the state, unless that lies outside the design.
    async fn predicted(&self, step: usize, means: &Means<'_>) -> Result<Result<Advice, OutsideDesign>, ServiceError> {
        let predict = move |advisor: &Advisor, state: &State, radius: Option<f64>| {
            let radius = radius.unwrap_or_else(|| advisor.radius(state));
            advisor.advise_from_surrogate(step, state, radius)
        };
        if means.advisor.is_prompt(step, &self.state) {
            return Ok(predict(&means.advisor, &self.state, self.radius));
        }
        let (advisor, state, radius) = (means.advisor.clone(), self.state.clone(), self.radius);
        means.advising.run(&self.row.tenant, move || predict(&advisor, &state, radius)).await
    }

    /// The state after `log_return`, and the answer to it; nothing is changed yet but the memoised advice.
    pub(super) async fn after(
        &mut self,
        report: &Observe,
        log_return: f64,
        means: &Means<'_>,
    ) -> Result<(State, Observed), ServiceError> {
        let Advice { allocation, band, .. } = *self.surrogate_advice(means).await?;
        let executed_allocation = report.executed_allocation.unwrap_or(allocation);
        let mut state = means.advisor.advance(self.observed(), &self.state, executed_allocation, log_return);
        state.wealth = match report.wealth {
            Some(reported) => reported,
            None => reached(state.wealth)?,
        };
        let (state, uncertainty) = self.measured(state, &means.advisor, means.advising).await?;
        let answer = Observed {
            session: report.session.clone(),
            period: report.period,
            log_return,
            band,
            executed_allocation,
            price: report.price,
            wealth: state.wealth,
            holding: state.holding,
            completed: report.period == self.row.horizon,
            uncertainty,
        };
        Ok((state, answer))
    }

    async fn measured(
        &self,
        state: State,
        advisor: &Arc<Advisor>,
        advising: &Bounded,
    ) -> Result<(State, Uncertainty), ServiceError> {
        let step = self.observed() + 1;
        if advisor.is_prompt(step, &state) {
            let uncertainty = advisor.uncertainty(&state);
            return Ok((state, uncertainty));
        }
        let measuring = advisor.clone();
        let measured = advising.run(&self.row.tenant, move || (measuring.uncertainty(&state), state)).await;
        let (uncertainty, state) = measured?;
        // The first session to get this far: the next advice finds its common random numbers simulated.
        let (advisor, reached) = (advisor.clone(), state.clone());
        tokio::task::spawn_blocking(move || advisor.prepare(step, &reached));
        Ok((state, uncertainty))
    }
}
