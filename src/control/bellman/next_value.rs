//! The value of the step after, as one robust step evaluates it.

use super::problem::Problem;
use crate::control::problem::dynamics::Trade;
use crate::control::problem::holdings::Holdings;
use crate::control::problem::state::State;
use crate::control::request::specification::Specification;
use crate::control::surrogate::features::FeatureSelection;
use crate::control::surrogate::stored::Solution;
use crate::control::surrogate::value_surrogate::ValueSurrogate;

/// The floor gains of a state, at even holdings.
pub type ExactGains = dyn Fn(&State) -> Vec<f64> + Send + Sync;

/// The value of the step after, ready to be evaluated.
pub enum NextValue {
    /// The horizon: no gain over the wealth reached, of which nothing is sold.
    Terminal,
    /// Constant floor gains for all states, at even holdings.
    Constant(Holdings, Vec<f64>),
    /// The clamped prediction of the step's value surrogate.
    Surrogate(Box<ValueSurrogate>),
    /// The exact floor gains, from any source: the reference for measuring a surrogate.
    Exact(Holdings, Box<ExactGains>),
}

impl NextValue {
    /// Builds the value of `after`, the solution of step `step`; `None` at the horizon.
    pub fn new(specification: &Specification, step: usize, after: Option<&Solution>) -> Self {
        match after {
            None => NextValue::Terminal,
            Some(Solution::Single(single)) => {
                let gains = single.floor_gains.clone();
                NextValue::Constant(Holdings::new(gains.len(), specification.problem.action_interval[1]), gains)
            }
            Some(Solution::Surrogates(stored)) => {
                NextValue::Surrogate(Box::new(ValueSurrogate::new(specification, step, stored)))
            }
        }
    }

    /// Returns the holdings at which the value is known.
    pub fn holdings(&self, problem: &Problem) -> Holdings {
        match self {
            NextValue::Terminal => problem.holdings(1),
            NextValue::Surrogate(surrogate) => surrogate.holdings(),
            NextValue::Constant(holdings, _) | NextValue::Exact(holdings, _) => *holdings,
        }
    }

    /// Returns true if the value depends on wealth.
    pub fn depends_on_wealth(&self, selection: &FeatureSelection) -> bool {
        match self {
            NextValue::Terminal | NextValue::Constant(..) => false,
            NextValue::Surrogate(surrogate) => selection.has_wealth() && surrogate.uses_first(),
            NextValue::Exact(..) => selection.has_wealth(),
        }
    }

    /// Returns predictions at every state that follows from `state` at `step` through one of `returns` (ascending)
    /// after one of `trades`. Their order is return by return, trade by trade, holding by holding; the table is empty
    /// if the value is constant. If the value does not depend on wealth, one trade is enough. Cost O(returns x trades x
    /// design points x holdings) at most: of trades that lead to a similar wealth two are enough.
    pub fn tabulate(
        &self,
        problem: &Problem,
        step: usize,
        state: &State,
        returns: &[f64],
        trades: &[Trade],
    ) -> Vec<f64> {
        let [dynamics, after] = [step, step + 1].map(|step| problem.dynamics(step));
        let start = state.wealth * dynamics.liquidation(state.holding);
        let wealth = |trade: &Trade, log_return: f64| {
            start * trade.kept * dynamics.growth(trade.action, log_return) + dynamics.contribution
        };
        let mut table = Vec::with_capacity(returns.len() * trades.len() * self.holdings(problem).count());
        match self {
            NextValue::Terminal | NextValue::Constant(..) => {}
            NextValue::Surrogate(surrogate) => {
                let moves = self.depends_on_wealth(&problem.selection);
                let total = dynamics.total(state.wealth, 0.0);
                for (law, &log_return) in problem.laws.summaries_with(&state.law, returns).iter().zip(returns) {
                    let features = &problem.selection.of(total, law);
                    if moves {
                        let totals = trades.iter().map(|trade| after.total(wealth(trade, log_return), 0.0));
                        table.extend(surrogate.predictions(features, totals.map(|x| problem.selection.wealth(x))));
                    } else {
                        table.extend(surrogate.prediction(features));
                    }
                }
            }
            NextValue::Exact(_, gains) => {
                for &log_return in returns {
                    let mut law = state.law.clone();
                    if problem.specification.problem.framework.learns() {
                        law.push(log_return);
                    }
                    let next =
                        |trade: &Trade| State { wealth: wealth(trade, log_return), holding: 0.0, law: law.clone() };
                    table.extend(trades.iter().flat_map(|trade| gains(&next(trade))));
                }
            }
        }
        table
    }

    /// Turns predictions into floor gains, in place. For each state, `totals` holds total wealth after selling all, for
    /// a holding no higher than the highest at which the value is known, and an upper bound on the gain.
    pub fn gains(&self, predictions: &mut [f64], totals: impl Iterator<Item = (f64, f64)>) {
        match self {
            NextValue::Terminal | NextValue::Constant(..) => {}
            NextValue::Surrogate(surrogate) => {
                for (prediction, (total, largest)) in predictions.iter_mut().zip(totals) {
                    *prediction = surrogate.clamped_gain(*prediction, total, [0.0, largest]);
                }
            }
            NextValue::Exact(..) => predictions.iter_mut().for_each(|gain| *gain = gain.max(0.0)),
        }
    }
}
