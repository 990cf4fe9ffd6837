//! A policy followed through given returns, as a live session follows it.

use super::advice::Advice;
use super::advisor::{AdviceMode, Advisor};
use crate::control::problem::state::{Realised, State};

/// Share of the largest effective size from which on a record counts as settled.
const SETTLED: f64 = 0.99;

/// An investor who follows a policy through given returns.
pub struct Walk<'a> {
    advisor: &'a Advisor,
    returns: &'a [f64],
    step: usize,
    /// Where he is now.
    pub state: State,
}

impl Iterator for Walk<'_> {
    type Item = Advice;

    fn next(&mut self) -> Option<Advice> {
        let log_return = *self.returns.get(self.step)?;
        let advice = self.advisor.advise(self.step, &self.state, AdviceMode::Surrogate);
        self.state = self.advisor.advance(self.step, &self.state, &Realised::of(advice.allocation, log_return));
        self.step += 1;
        Some(advice)
    }
}

impl Advisor {
    /// Whether a record of so many returns is as long as any to what is learned of it: its effective size is within a hundredth of
    /// what that tends to. Then laws move on and their precision does not, and [`Self::advise`] at step 0 serves every period.
    /// Checked by: `tests/learning.rs::the_first_step_serves_every_law_once_the_record_has_settled`.
    pub fn is_settled(&self, returns: usize) -> bool {
        self.specification().problem.learning.settled(returns) >= SETTLED
    }

    /// The advice before each of `returns`, followed; at most `horizon` returns are used.
    pub fn walk<'a>(&'a self, start: State, returns: &'a [f64]) -> Walk<'a> {
        let horizon = self.specification().problem.horizon;
        Walk { advisor: self, returns: &returns[..returns.len().min(horizon)], step: 0, state: start }
    }
}
