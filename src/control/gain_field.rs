//! The floor gain of the step after, over everything one robust step can reach.
//!
//! From one state, the next state depends on the action and the adversary's return z only. The law's features
//! depend on z alone, and wealth on both, linearly in the action. The prediction is a smooth function of the two, so
//! it is tabulated once, exactly, at a few returns (local cubics between them) times a few Chebyshev nodes in the
//! action, and every action is then priced without touching the surrogate again: a product a node and return.

use super::context::ProblemContext;
use super::state::{State, next_wealth};
use super::surrogate::{NextValue, ValueSurrogate, wealth_is_active};
use crate::numerics::chebyshev::{Chebyshev, local_cubic};

/// Chebyshev nodes in the action.
const ACTION_NODES: usize = 4;

/// What of the problem the field needs.
#[derive(Clone, Copy)]
pub struct FieldContext<'a> {
    pub problem: &'a ProblemContext,
    pub next: &'a NextValue,
    pub rate_per_step: f64,
    pub highest_action: f64,
}

/// Predictions tabulated over returns and actions, for one state.
pub struct GainField<'a> {
    context: FieldContext<'a>,
    wealth: f64,
    returns: Vec<f64>,
    action_nodes: Chebyshev,
    /// `table[i * nodes + m]`: the prediction at return i and action node m.
    table: Vec<f64>,
}

impl<'a> GainField<'a> {
    /// `returns` ascending and distinct. Cost O(returns x nodes x design count).
    pub fn tabulate(context: FieldContext<'a>, state: &State, returns: Vec<f64>) -> Self {
        let mut field =
            GainField { context, wealth: state.wealth, returns, action_nodes: Chebyshev::new(1), table: Vec::new() };
        let wealth_matters = match context.next {
            NextValue::Terminal | NextValue::Constant(_) => return field,
            NextValue::Surrogate(surrogate) => wealth_is_active(&context.problem.selection, &surrogate.scaling),
            NextValue::Exact(_) => context.problem.selection.has_wealth(),
        };
        field.action_nodes = Chebyshev::new(if wealth_matters { ACTION_NODES } else { 1 });
        match context.next {
            NextValue::Surrogate(surrogate) => field.fill(state, surrogate, wealth_matters),
            NextValue::Exact(gain) => field.fill_exactly(state, gain),
            NextValue::Terminal | NextValue::Constant(_) => {}
        }
        field
    }

    fn fill_exactly(&mut self, state: &State, gain: &(dyn Fn(&State) -> f64 + Send + Sync)) {
        for &log_return in &self.returns {
            let mut law = state.law.clone();
            if self.context.problem.specification.problem.framework.learns() {
                law.push(log_return);
            }
            for &node in self.action_nodes.nodes() {
                self.table.push(gain(&State { wealth: self.wealth_at(node, log_return), law: law.clone() }));
            }
        }
    }

    fn fill(&mut self, state: &State, surrogate: &ValueSurrogate, wealth_matters: bool) {
        let features = self.context.problem.features_with(&state.law, self.wealth, &self.returns);
        let count = surrogate.scaling.active.len();
        let mut law_part = vec![0.0; surrogate.mean.input_count()];
        let mut squared = law_part.clone();
        for (index, features) in features.iter().enumerate() {
            let mut input = surrogate.scaling.apply(features);
            if !wealth_matters {
                surrogate.mean.squared_distances(&input, 0..count, &mut squared);
                self.table.push(surrogate.offset + surrogate.scale * surrogate.mean.mean_from_squared(&squared));
                continue;
            }
            surrogate.mean.squared_distances(&input, 1..count, &mut law_part);
            for &node in self.action_nodes.nodes() {
                let wealth = self.wealth_at(node, self.returns[index]);
                let feature = self.context.problem.selection.wealth(wealth);
                input[0] = (feature - surrogate.scaling.centre[0]) / surrogate.scaling.spread[0];
                surrogate.mean.squared_distances(&input, 0..1, &mut squared);
                for (total, law) in squared.iter_mut().zip(&law_part) {
                    *total += law;
                }
                self.table.push(surrogate.offset + surrogate.scale * surrogate.mean.mean_from_squared(&squared));
            }
        }
    }

    /// The next wealth at a share of the highest action.
    fn wealth_at(&self, share: f64, log_return: f64) -> f64 {
        next_wealth(self.wealth, share * self.context.highest_action, log_return, self.context.rate_per_step)
    }

    /// Prepares evaluation at fixed returns.
    pub fn at<'f>(&'f self, returns: &[f64]) -> FieldRows<'f, 'a> {
        let nodes = self.action_nodes.nodes().len();
        let mut rows = vec![0.0; if self.table.is_empty() { 0 } else { nodes * returns.len() }];
        if !self.table.is_empty() {
            for (index, &log_return) in returns.iter().enumerate() {
                let (first, weights) = local_cubic(&self.returns, log_return);
                for node in 0..nodes {
                    let values = (0..weights.len()).filter(|i| weights[*i] != 0.0);
                    rows[node * returns.len() + index] =
                        values.map(|i| weights[i] * self.table[(first + i) * nodes + node]).sum();
                }
            }
        }
        let excesses = returns.iter().map(|z| z.exp() / (1.0 + self.context.rate_per_step) - 1.0).collect();
        FieldRows { field: self, rows, excesses }
    }
}

/// A field restricted to fixed returns.
pub struct FieldRows<'f, 'a> {
    field: &'f GainField<'a>,
    /// `rows[m * returns + k]`: the prediction at action node m and return k; empty where the gain is known.
    rows: Vec<f64>,
    /// `e^z / (1 + r) - 1`: what a unit of allocation earns beyond the bank.
    excesses: Vec<f64>,
}

impl FieldRows<'_, '_> {
    /// Wealth over all-bank wealth after one step with `action`, and the floor gain of the step after, return by return.
    /// Cost O(returns x nodes).
    pub fn at_action(&self, action: f64) -> (Vec<f64>, Vec<f64>) {
        let relative: Vec<f64> = self.excesses.iter().map(|excess| 1.0 + action * excess).collect();
        let gains = match self.field.context.next {
            NextValue::Terminal => vec![0.0; relative.len()],
            NextValue::Constant(gain) => vec![*gain; relative.len()],
            NextValue::Exact(_) => {
                let mut gains = self.interpolated(action);
                gains.iter_mut().for_each(|gain| *gain = gain.max(0.0));
                gains
            }
            NextValue::Surrogate(surrogate) => {
                let mut gains = self.interpolated(action);
                let bank = self.field.wealth * (1.0 + self.field.context.rate_per_step);
                for (gain, relative) in gains.iter_mut().zip(&relative) {
                    *gain = surrogate.clamped_gain(*gain, bank * relative);
                }
                gains
            }
        };
        (relative, gains)
    }

    /// The tabulated predictions, along the action.
    fn interpolated(&self, action: f64) -> Vec<f64> {
        let count = self.excesses.len();
        let basis = self.field.action_nodes.basis(action / self.field.context.highest_action);
        let mut predictions = vec![0.0; count];
        for (weight, row) in basis.iter().zip(self.rows.chunks_exact(count)) {
            predictions.iter_mut().zip(row).for_each(|(prediction, value)| *prediction += weight * value);
        }
        predictions
    }
}
