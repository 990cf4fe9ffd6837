//! The investor as a controlled problem: wealth alone, with the share held if trading costs, and with contributions and
//! withdrawals.

use super::actions::{ActionInterval, ActionSet};
use super::controlled::Controlled;
use super::dynamics::Dynamics;
use super::utility::{relative_utility, worth_of_utility};
use crate::control::request::specification::ProblemSpecification;

/// The problem of a specification, without its law.
pub struct Investor {
    problem: ProblemSpecification,
    periods: Vec<Dynamics>,
}

/// Wealth and the share of it held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// x.
    pub wealth: f64,
    /// h.
    pub holding: f64,
}

impl Investor {
    /// Builds the investor of a completed specification.
    pub fn new(problem: &ProblemSpecification) -> Self {
        Investor { problem: problem.clone(), periods: Dynamics::of(problem) }
    }
}

impl Controlled for Investor {
    type State = Position;

    fn actions(&self, step: usize, state: &Position) -> Vec<ActionSet> {
        let [lowest, highest] = self.problem.action_interval;
        let highest = self.periods[step].highest_action(state.wealth, highest);
        vec![ActionSet::Interval(ActionInterval { lowest, highest })]
    }

    fn next(&self, step: usize, state: &Position, actions: &[f64], noise: f64) -> Position {
        let (wealth, holding) = self.periods[step].next(state.wealth, state.holding, actions[0], noise);
        Position { wealth, holding }
    }

    /// Returns total wealth if it matters, and the share held if trading costs.
    fn describe(&self, step: usize, state: &Position) -> Vec<f64> {
        let mut described = Vec::new();
        if self.problem.depends_on_wealth() {
            described.push(self.periods[step].total(state.wealth, 0.0).ln());
        }
        if self.problem.trading_cost > 0.0 {
            described.push(state.holding);
        }
        described
    }

    fn baseline(&self, step: usize, state: &Position) -> f64 {
        // At the horizon nothing more is sold.
        let holding = if step == self.problem.horizon { 0.0 } else { state.holding };
        self.periods[step].floor(state.wealth, holding, self.problem.horizon - step)
    }

    fn utility(&self, worth: f64, from: f64) -> f64 {
        relative_utility(self.problem.utility, worth, from)
    }

    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64 {
        worth_of_utility(self.problem.utility, utility, from)
    }

    /// Returns ln(worth / baseline).
    fn gain(&self, worth: f64, baseline: f64) -> f64 {
        (worth / baseline).ln()
    }

    fn worth(&self, gain: f64, baseline: f64) -> f64 {
        baseline * gain.exp()
    }
}
