//! Follows a policy through given returns, as a live session does.

use super::advice::Advice;
use super::advisor::{AdviceMode, Advisor};
use crate::control::problem::state::State;
use crate::control::request::specification::{InitialLaws, Specification};

/// Share of the largest effective sample size from which a record counts as settled.
const SETTLED: f64 = 0.99;

/// An investor who follows a policy through given returns.
pub struct Walk<'a> {
    advisor: &'a Advisor,
    returns: &'a [f64],
    step: usize,
    /// The current state.
    pub state: State,
}

impl Iterator for Walk<'_> {
    type Item = Advice;

    fn next(&mut self) -> Option<Advice> {
        let log_return = *self.returns.get(self.step)?;
        let advice = self.advisor.advise(self.step, &self.state, AdviceMode::Surrogate);
        self.state = self.advisor.advance(self.step, &self.state, &advice.followed(log_return));
        self.step += 1;
        Some(advice)
    }
}

impl Advisor {
    /// Returns the number of returns from which a record counts as settled: its effective sample size is within a
    /// hundredth of its limit. From then on laws change but their precision does not. `None` if it grows without limit.
    /// Checked by: `tests/solver/learning.rs::the_first_step_serves_every_law_once_the_record_has_settled`.
    pub fn settled_from(&self) -> Option<usize> {
        self.specification().problem.learning.settled_from(SETTLED)
    }

    /// Checks that [`Self::advise`] at step 0 serves every period of an investor who starts from `returns` returns. Its
    /// surrogates must be trained over laws like those of later periods, and periods may differ only in the law.
    /// Checked by: `tests/solver/learning.rs::a_session_that_cannot_roll_is_refused`.
    ///
    /// # Errors
    /// The rule that is broken.
    pub fn check_rolling(&self, returns: usize) -> Result<(), String> {
        let Specification { problem, design, .. } = self.specification();
        let refused = |rule: &str| Err(format!("a rolling session needs a policy {rule}"));
        let Some(settled) = self.settled_from().filter(|_| problem.framework.learns()) else {
            return refused("that learns with decay");
        };
        if design.initial_laws != InitialLaws::Resampled {
            return refused("whose design.initial_laws is resampled");
        }
        if problem.spending.is_some() {
            return refused("without spending, whose horizon does not come nearer");
        }
        if problem.depends_on_wealth() {
            return refused("whose advice does not depend on wealth; use power or log utility and no contributions");
        }
        for (count, whose) in [(problem.history.len(), "the policy's own history has"), (returns, "there are")] {
            if count < settled {
                return Err(format!(
                    "a rolling session needs at least {settled} returns with this half-life, but {whose} {count}"
                ));
            }
        }
        Ok(())
    }

    /// Follows the advice before each of `returns`; at most `horizon` returns are used.
    pub fn walk<'a>(&'a self, start: State, returns: &'a [f64]) -> Walk<'a> {
        let horizon = self.specification().problem.horizon;
        Walk { advisor: self, returns: &returns[..returns.len().min(horizon)], step: 0, state: start }
    }
}
