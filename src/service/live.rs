//! One live session in memory.

use std::sync::Arc;

use super::bounded::Bounded;
use super::error::ServiceError;
use super::observation::{Observe, Observed};
use crate::control::advisor::{Advice, AdviceMode, Advisor};
use crate::control::error::FieldError;
use crate::control::limits;
use crate::control::state::State;
use crate::store::{Head, SessionRow};

/// A session replayed from its rows.
#[derive(Clone)]
pub struct Live {
    pub row: SessionRow,
    pub state: State,
    /// Of the rows it was replayed from.
    pub(super) head: Head,
    pub(super) advisor: Arc<Advisor>,
    /// Price reported for the last period.
    pub(super) price: Option<f64>,
    /// The surrogate's advice for the coming period, once computed.
    pub(super) advice: Option<Advice>,
}

impl Live {
    /// Periods observed.
    pub fn observed(&self) -> usize {
        self.head.observed
    }

    pub(super) fn taken_to(&self, head: Head, state: State, price: Option<f64>) -> Live {
        Live { head, state, price, advice: None, ..self.clone() }
    }

    pub(super) fn expects(&self, period: usize) -> Result<(), ServiceError> {
        if self.observed() >= self.row.horizon {
            return Err(ServiceError::PastHorizon { given: period, horizon: self.row.horizon });
        }
        let expected = self.observed() + 1;
        if period == expected { Ok(()) } else { Err(ServiceError::PeriodGap { given: period, expected }) }
    }

    /// The surrogate's advice for the coming period, computed once.
    pub(super) async fn surrogate_advice(&mut self, advising: &Bounded) -> Result<Advice, ServiceError> {
        if let Some(advice) = &self.advice {
            return Ok(advice.clone());
        }
        let (advisor, state, step) = (self.advisor.clone(), self.state.clone(), self.observed());
        let advice = advising.run(move || advisor.advise(step, &state, AdviceMode::Surrogate)).await?;
        self.advice = Some(advice.clone());
        Ok(advice)
    }

    /// The state after `log_return`, and the answer to it; nothing is changed yet but the memoised advice.
    pub(super) async fn after(
        &mut self,
        report: &Observe,
        log_return: f64,
        advising: &Bounded,
    ) -> Result<(State, Observed), ServiceError> {
        let advised = self.surrogate_advice(advising).await?.allocation;
        let executed_allocation = report.executed_allocation.unwrap_or(advised);
        let (advisor, before, stated) = (self.advisor.clone(), self.state.clone(), report.wealth);
        let advancing = advising.run(move || {
            let mut state = advisor.advance(&before, executed_allocation, log_return);
            state.wealth = stated.unwrap_or(state.wealth);
            limits::within("wealth", state.wealth, limits::WEALTH.0, limits::WEALTH.1)?;
            let uncertainty = advisor.uncertainty(&state);
            Ok::<_, FieldError>((state, uncertainty))
        });
        let (state, uncertainty) = advancing.await??;
        let answer = Observed {
            session: report.session.clone(),
            period: report.period,
            log_return,
            executed_allocation,
            price: report.price,
            wealth: state.wealth,
            completed: report.period == self.row.horizon,
            uncertainty,
        };
        Ok((state, answer))
    }
}
