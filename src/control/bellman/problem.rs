//! The investor's problem with everything that does not change from step to step: its laws, its dynamics and its
//! features.

use crate::control::cache::Cache;
use crate::control::error::FieldError;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::holdings::Holdings;
use crate::control::problem::state::State;
use crate::control::request::specification::{ProblemSpecification, Specification, UtilitySpecification};
use crate::control::request::support::Support;
use crate::control::request::withdrawals::check_bank;
use crate::control::surrogate::features::{FeatureSelection, Features};
use crate::control::uncertainty::laws::{LawSummary, Laws};
use crate::numerics::law::empirical::EmpiricalDistribution;

/// The problem of a completed specification.
pub struct Problem {
    /// The completed specification.
    pub specification: Specification,
    /// Uncertainty sets and summaries of the laws learned.
    pub laws: Laws,
    /// The features of a state that the surrogates use.
    pub selection: FeatureSelection,
    /// The dynamics of every period, and of the time after the last.
    periods: Vec<Dynamics>,
}

impl Problem {
    /// Builds the problem of a completed specification.
    pub fn new(specification: &Specification) -> Self {
        Problem::with(specification, Cache::default())
    }

    /// Builds the problem with `kept` as the cache of recomputable results.
    pub fn with(specification: &Specification, kept: Cache) -> Self {
        let laws = Laws::with(specification, kept);
        let selection = FeatureSelection::new(specification, &laws);
        let periods = Dynamics::of(&specification.problem);
        Problem { specification: specification.clone(), laws, selection, periods }
    }

    /// Returns `count` holdings if trading costs; otherwise the holding does not matter, and one is enough.
    pub fn holdings(&self, count: usize) -> Holdings {
        let problem = &self.specification.problem;
        Holdings::new(if problem.trading_cost > 0.0 { count } else { 1 }, problem.action_interval[1])
    }

    /// Returns A, the shares of wealth that may be held in the period after `step`.
    pub fn actions(&self, step: usize, state: &State) -> ActionInterval {
        let [lowest, highest] = self.specification.problem.action_interval;
        ActionInterval { lowest, highest: self.dynamics(step).highest_action(state.wealth, highest) }
    }

    /// Returns S of the period after `step`, which is at most the horizon.
    pub fn dynamics(&self, step: usize) -> Dynamics {
        self.periods[step.min(self.periods.len() - 1)]
    }

    /// Returns an action of 1 as a share of total wealth, before anything is sold: the surrogates know actions as
    /// shares of that.
    pub fn unit_of_action(&self, step: usize, state: &State) -> f64 {
        self.dynamics(step).in_hand(state.wealth, 0.0)
    }

    /// Returns the worth of a state at `step` if all wealth stays in the bank.
    pub fn floor(&self, step: usize, state: &State) -> f64 {
        self.dynamics(step).floor(state.wealth, state.holding, self.specification.problem.horizon - step)
    }

    /// Checks that the bank alone pays for every withdrawal, starting from the wealth left after selling everything in
    /// the first state.
    ///
    /// # Errors
    /// The bank runs dry; the field is `wealth`.
    pub fn check_withdrawals(&self, state: &State) -> Result<(), FieldError> {
        if let Some(reserve) = self.dynamics(0).spending.map(|own| own.reserve)
            && reserve > 0.0
            && state.wealth <= reserve
        {
            let rule = format!("must be above {reserve}, which pays from the bank for what problem.spending secures");
            return Err(FieldError::new("wealth", state.wealth, rule));
        }
        let liquidated = state.wealth * self.dynamics(0).liquidation(state.holding);
        let periods = &self.periods[..self.periods.len() - 1];
        check_bank(periods, liquidated).map_err(|rule| FieldError::new("wealth", state.wealth, rule))
    }

    /// Returns the derivative of U at the floor times the floor, which turns relative utility into utility.
    pub fn utility_at_floor(&self, step: usize, state: &State) -> f64 {
        let floor = self.floor(step, state);
        match self.specification.problem.utility {
            UtilitySpecification::Exponential { risk_aversion, .. } => floor * (-risk_aversion * floor).exp(),
            UtilitySpecification::Power { risk_aversion } => floor.powf(1.0 - risk_aversion),
            UtilitySpecification::Log {} => 1.0,
        }
    }

    /// Returns true if some law in a ball of this radius wipes out an allocation: all wealth, under power utility and
    /// without a least return. A slightly wrong surrogate may advise it; the step solved anew never does.
    pub fn is_ruined(&self, radius: f64, allocation: f64) -> bool {
        let problem = &self.specification.problem;
        let has_ball = problem.framework.has_ball() && radius > 0.0;
        let is_power = matches!(problem.utility, UtilitySpecification::Power { .. });
        has_ball && is_power && problem.support_rule() == (Support::None {}) && allocation >= 1.0
    }

    /// Returns an upper bound on the floor gain of a state at `step`: the gain at the best return of its centre in
    /// every period. The worst law of a ball is no better than its centre, and learning one of its own returns leaves
    /// the best as it is.
    pub fn largest_gain(&self, step: usize, state: &State) -> f64 {
        let problem = &self.specification.problem;
        let best = self.laws.best_return(&state.law, problem.horizon - step);
        let [all, unsold] = [state.holding, 0.0].map(|holding| self.dynamics(step).total(state.wealth, holding));
        largest_gain(problem, step, best) + (unsold / all).ln()
    }

    /// Returns the bound of [`Self::largest_gain`] for the states with nothing held that follow from one with `law` at
    /// `step`, through each of `returns`.
    pub fn largest_gains_after(&self, step: usize, law: &EmpiricalDistribution, returns: &[f64]) -> Vec<f64> {
        let problem = &self.specification.problem;
        let periods = problem.horizon.saturating_sub(step + 1);
        // Most returns leave the best return as it is.
        let (mut last, mut gain) = (f64::NAN, f64::NAN);
        let largest = |&log_return: &f64| {
            let best = self.laws.best_return_with(law, log_return, periods);
            if best != last {
                (last, gain) = (best, largest_gain(problem, step + 1, best));
            }
            gain
        };
        returns.iter().map(largest).collect()
    }

    /// Returns the features of a state, unscaled.
    pub fn features(&self, step: usize, state: &State) -> Features {
        self.features_of(step, state.wealth, &self.laws.summary(&state.law))
    }

    /// Returns the features if the radius of the state is known already.
    pub fn features_within(&self, step: usize, state: &State, radius: f64) -> Features {
        self.features_of(step, state.wealth, &self.laws.summary_within(&state.law, radius))
    }

    /// Returns the features if the law is summed up already.
    pub fn features_of(&self, step: usize, wealth: f64, law: &LawSummary) -> Features {
        self.selection.of(self.dynamics(step).total(wealth, 0.0), law)
    }
}

/// Returns the floor gain from `step` of the highest allocation if every period earns `best_return`:
///
///   (T - t) ln(1 + a ((e^z / (1 + r)) - 1)),   z the best return,
///
/// a the highest allocation, or with contributions or withdrawals 1, the largest share of total wealth that an action
/// can be. A holding before trading also gains the cost of selling it.
pub fn largest_gain(problem: &ProblemSpecification, step: usize, best_return: f64) -> f64 {
    let bank = problem.rate_per_step.ln_1p();
    let excess = (best_return - bank).exp_m1().max(0.0);
    let highest = if problem.contributions.are_none() { problem.action_interval[1] } else { 1.0 };
    (problem.horizon - step) as f64 * (highest * excess).ln_1p()
}
