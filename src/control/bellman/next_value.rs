//! The value of the step after, as one robust step sees it.

use super::problem::Problem;
use crate::control::problem::state::{State, next_wealth};
use crate::control::request::specification::Specification;
use crate::control::surrogate::features::FeatureSelection;
use crate::control::surrogate::fitted::ValueSurrogate;
use crate::control::surrogate::stored::Solution;
use crate::control::surrogate::target::TargetMap;

/// The value of the step after, ready to be evaluated.
pub enum NextValue {
    /// The horizon: no gain over the wealth reached.
    Terminal,
    /// The same floor gain everywhere.
    Constant(f64),
    /// The clamped prediction of the step's value surrogate.
    Surrogate(Box<ValueSurrogate>),
    /// The floor gain itself, however it is known: what a surrogate is measured against.
    Exact(Box<dyn Fn(&State) -> f64 + Send + Sync>),
}

impl NextValue {
    /// `after` is the solution of step `step`; `None` at the horizon.
    pub fn new(specification: &Specification, step: usize, after: Option<&Solution>) -> Self {
        match after {
            None => NextValue::Terminal,
            Some(Solution::Single(single)) => NextValue::Constant(single.floor_gain),
            Some(Solution::Surrogates(stored)) => {
                NextValue::Surrogate(Box::new(ValueSurrogate::new(stored, TargetMap::new(specification, step))))
            }
        }
    }

    /// The floor gain where it is the same everywhere.
    pub fn constant(&self) -> Option<f64> {
        match self {
            NextValue::Terminal => Some(0.0),
            NextValue::Constant(gain) => Some(*gain),
            NextValue::Surrogate(_) | NextValue::Exact(_) => None,
        }
    }

    /// True where wealth moves it.
    pub fn depends_on_wealth(&self, selection: &FeatureSelection) -> bool {
        match self {
            NextValue::Terminal | NextValue::Constant(_) => false,
            NextValue::Surrogate(surrogate) => selection.has_wealth() && surrogate.scaling.active.first() == Some(&0),
            NextValue::Exact(_) => selection.has_wealth(),
        }
    }

    /// Predictions at every state that follows from `state` through one of `returns` (ascending) with one of `actions`,
    /// return by return; nothing where the value is constant. Cost O(returns x actions x design points).
    pub fn tabulate(&self, problem: &Problem, state: &State, returns: &[f64], actions: &[f64]) -> Vec<f64> {
        let rate = problem.specification.problem.rate_per_step;
        let wealth = |action: f64, log_return: f64| next_wealth(state.wealth, action, log_return, rate);
        let mut table = Vec::with_capacity(returns.len() * actions.len());
        match self {
            NextValue::Terminal | NextValue::Constant(_) => {}
            NextValue::Surrogate(surrogate) => {
                let moves = self.depends_on_wealth(&problem.selection);
                let features = problem.features_with(&state.law, state.wealth, returns);
                for (features, &log_return) in features.iter().zip(returns) {
                    if moves {
                        let wealths = actions.iter().map(|&action| wealth(action, log_return));
                        table.extend(surrogate.predictions(features, wealths.map(|x| problem.selection.wealth(x))));
                    } else {
                        table.push(surrogate.prediction(features));
                    }
                }
            }
            NextValue::Exact(gain) => {
                for &log_return in returns {
                    let mut law = state.law.clone();
                    if problem.specification.problem.framework.learns() {
                        law.push(log_return);
                    }
                    let of = |&action: &f64| gain(&State { wealth: wealth(action, log_return), law: law.clone() });
                    table.extend(actions.iter().map(of));
                }
            }
        }
        table
    }

    /// Turns predictions into floor gains, in place; `wealths` are those of their states.
    pub fn gains(&self, predictions: &mut [f64], wealths: impl Iterator<Item = f64>) {
        match self {
            NextValue::Terminal | NextValue::Constant(_) => {}
            NextValue::Surrogate(surrogate) => {
                for (prediction, wealth) in predictions.iter_mut().zip(wealths) {
                    *prediction = surrogate.clamped_gain(*prediction, wealth);
                }
            }
            NextValue::Exact(_) => predictions.iter_mut().for_each(|gain| *gain = gain.max(0.0)),
        }
    }
}
