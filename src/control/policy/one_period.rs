//! Advice for a single period, of a problem that no policy was trained for: the robust step at the horizon, which is solved
//! exactly and needs no surrogate.

use super::advice::Advice;
use super::advisor::Advisor;
use super::document::Policy;
use super::worst_case::WorstCase;
use crate::control::error::FieldError;
use crate::control::kept::Kept;
use crate::control::request::specification::Specification;
use crate::control::solved_step::StepSolution;

/// An investor whose horizon is the end of this period.
pub struct OnePeriod(Advisor);

impl OnePeriod {
    /// Of a completed specification of horizon 1, what can be made again in `kept`.
    pub fn new(specification: &Specification, kept: Kept) -> Self {
        OnePeriod(Advisor::with(Policy::new(specification.clone(), vec![StepSolution::unsolved(0)]), kept))
    }

    /// Bytes of the bridges that its radius asks for.
    pub fn bridges(&self) -> usize {
        self.0.heaviest_bridges(self.0.specification().problem.history.len())
    }

    /// The advice for who holds the share `holding` of the initial wealth, and the worst law behind it.
    /// Cost: the radius, and a robust step.
    ///
    /// # Errors
    /// A holding that is no share, or one whose sale leaves less than is withdrawn.
    pub fn advise(&self, holding: f64) -> Result<(Advice, WorstCase), FieldError> {
        let state = self.0.initial_state(None, None)?.with_holding(holding)?;
        self.0.check_withdrawals(&state)?;
        Ok(self.0.explain(0, &state))
    }
}
