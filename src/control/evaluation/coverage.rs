//! How often balls held the true law, and lay inside the first ball of their path.

use crate::control::evaluation::names::quoted;
use crate::control::evaluation::paths::Lived;
use crate::control::evaluation::report::{Coverage, CoverageAtSize, StrategyReport};
use crate::control::evaluation::statistics::SimulationTable;

/// Tolerance of a ball inside another, as a share of the larger radius: a distance of 0 may be a few roundings.
const ROUNDING: f64 = 1e-12;

impl SimulationTable<'_> {
    /// Returns the coverage of a framework with a ball.
    pub(super) fn coverage(&self, index: usize) -> Coverage {
        let problem = &self.evaluation.request.problem;
        let steps = index * problem.horizon..(index + 1) * problem.horizon;
        let (left, outcomes) = (|lived: &Lived| lived.distance > lived.radius, &self.outcomes.outcomes);
        let at_size = |step: usize| CoverageAtSize {
            sample_size: problem.history.len() + step,
            covered: self.sample.share(outcomes, |outcome| !left(&outcome.lived[steps.start + step])),
            inside_first: self.sample.share(outcomes, |outcome| {
                let (first, lived) = (&outcome.lived[steps.start], &outcome.lived[steps.start + step]);
                lived.moved + lived.radius <= (1.0 + ROUNDING) * first.radius
            }),
        };
        // A frozen ball is the same in all periods.
        let count = if self.followers[index].framework.learns() { problem.horizon } else { 1 };
        Coverage {
            target: problem.radius_rule().alpha().map(|alpha| 1.0 - alpha),
            by_sample_size: (0..count).map(at_size).collect(),
            ever_left: self.sample.share(outcomes, |outcome| outcome.lived[steps.clone()].iter().any(left)),
        }
    }
}

impl StrategyReport {
    /// Says how often the last ball lay inside the first; `None` if the strategy has no ball that moves.
    pub(super) fn inside_first(&self) -> Option<String> {
        let [_, .., CoverageAtSize { sample_size, inside_first, .. }] = &self.coverage.as_ref()?.by_sample_size[..]
        else {
            return None;
        };
        Some(format!(
            "{}: after {sample_size} returns, the ball lay inside the first ball of its path on {:.0} % of the paths. \
             There it holds only laws that the first advice was already robust against.",
            quoted(&self.strategy),
            100.0 * inside_first.value
        ))
    }
}
