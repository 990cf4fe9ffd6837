//! A policy followed through given returns, as a live session follows it.

use super::advice::Advice;
use super::advisor::{AdviceMode, Advisor};
use crate::control::problem::state::{Realised, State};

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
    /// The advice before each of `returns`, followed; at most `horizon` returns are used.
    pub fn walk<'a>(&'a self, start: State, returns: &'a [f64]) -> Walk<'a> {
        let horizon = self.specification().problem.horizon;
        Walk { advisor: self, returns: &returns[..returns.len().min(horizon)], step: 0, state: start }
    }
}
