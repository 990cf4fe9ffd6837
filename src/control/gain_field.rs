//! The floor gain of the step after, over everything one robust step can reach.
//!
//! From one state, the next state depends on the action and the adversary's return z only. The law's features
//! depend on z alone, and log wealth runs between all-bank and the highest action. The prediction is a smooth
//! function on that strip, so it is tabulated once, exactly, at a few returns (local cubics between them) times a
//! few Chebyshev nodes in log wealth, and every action is then priced without touching the surrogate again.

use super::context::ProblemContext;
use super::state::{State, growth};
use super::surrogate::{NextValue, ValueSurrogate, wealth_is_active};
use crate::numerics::chebyshev::{Chebyshev, local_cubic};

/// Chebyshev nodes in log wealth.
const WEALTH_NODES: usize = 9;

/// What of the problem the field needs.
#[derive(Clone, Copy)]
pub struct FieldContext<'a> {
    pub problem: &'a ProblemContext,
    pub next: &'a NextValue,
    pub rate_per_step: f64,
    pub highest_action: f64,
}

/// Predictions tabulated over returns and wealth, for one state.
pub struct GainField<'a> {
    context: FieldContext<'a>,
    wealth: f64,
    returns: Vec<f64>,
    wealth_nodes: Chebyshev,
    /// `table[i * nodes + m]`: the prediction at return i and wealth node m.
    table: Vec<f64>,
}

impl<'a> GainField<'a> {
    /// `returns` ascending and distinct. Cost O(returns x nodes x design count).
    pub fn tabulate(context: FieldContext<'a>, state: &State, returns: Vec<f64>) -> Self {
        let mut field =
            GainField { context, wealth: state.wealth, returns, wealth_nodes: Chebyshev::new(1), table: Vec::new() };
        let wealth_matters = match context.next {
            NextValue::Terminal | NextValue::Constant(_) => return field,
            NextValue::Surrogate(surrogate) => wealth_is_active(&context.problem.selection, &surrogate.scaling),
            NextValue::Exact(_) => context.problem.selection.has_wealth(),
        };
        field.wealth_nodes = Chebyshev::new(if wealth_matters { WEALTH_NODES } else { 1 });
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
            let (bank, full) = self.wealth_range(log_return);
            for node in self.wealth_nodes.nodes() {
                let next = State { wealth: self.wealth * (bank + node * (full - bank)).exp(), law: law.clone() };
                self.table.push(gain(&next));
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
            let (bank, full) = self.wealth_range(self.returns[index]);
            for node in self.wealth_nodes.nodes() {
                let wealth = self.wealth * (bank + node * (full - bank)).exp();
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

    /// Log growth of wealth at action 0 and at the highest action.
    fn wealth_range(&self, log_return: f64) -> (f64, f64) {
        let bank = self.context.rate_per_step.ln_1p();
        (bank, growth(self.context.highest_action, log_return, self.context.rate_per_step).ln())
    }

    /// Prepares evaluation at fixed returns: one row of wealth-node predictions per return.
    pub fn at<'f>(&'f self, returns: &[f64]) -> FieldRows<'f, 'a> {
        let nodes = self.wealth_nodes.nodes().len();
        let mut rows = Vec::new();
        if !self.table.is_empty() {
            rows.reserve(returns.len() * nodes);
            for &log_return in returns {
                let (first, weights) = local_cubic(&self.returns, log_return);
                for node in 0..nodes {
                    let values = (0..weights.len()).filter(|i| weights[*i] != 0.0);
                    rows.push(values.map(|i| weights[i] * self.table[(first + i) * nodes + node]).sum());
                }
            }
        }
        let ranges = returns.iter().map(|&log_return| self.wealth_range(log_return)).collect();
        FieldRows { field: self, rows, ranges }
    }
}

/// A field restricted to fixed returns.
pub struct FieldRows<'f, 'a> {
    field: &'f GainField<'a>,
    rows: Vec<f64>,
    ranges: Vec<(f64, f64)>,
}

impl FieldRows<'_, '_> {
    /// Floor gain of the step after at return `index` and log growth `log_growth` of wealth.
    pub fn gain(&self, index: usize, log_growth: f64) -> f64 {
        match self.field.context.next {
            NextValue::Terminal => 0.0,
            NextValue::Constant(gain) => *gain,
            NextValue::Surrogate(surrogate) => {
                surrogate.clamped_gain(self.interpolated(index, log_growth), self.field.wealth * log_growth.exp())
            }
            NextValue::Exact(_) => self.interpolated(index, log_growth).max(0.0),
        }
    }

    /// The tabulated prediction, along wealth.
    fn interpolated(&self, index: usize, log_growth: f64) -> f64 {
        let nodes = self.field.wealth_nodes.nodes().len();
        let row = &self.rows[index * nodes..(index + 1) * nodes];
        if nodes == 1 {
            return row[0];
        }
        let (bank, full) = self.ranges[index];
        let position = if full == bank { 0.0 } else { (log_growth - bank) / (full - bank) };
        self.field.wealth_nodes.evaluate(row, position)
    }
}
