//! The floor gain of the step after, over everything one robust step can reach.
//!
//! From one state, the next state depends on the action and the adversary's return z only. The law's features
//! depend on z alone, and wealth on both, linearly in the action. The prediction is a smooth function of the two, so
//! it is tabulated once, exactly, at a few returns (local cubics between them) times a few Chebyshev nodes in the
//! action, and every action is then priced without touching the surrogate again: a product a node and return.

use super::next_value::NextValue;
use super::problem::Problem;
use crate::control::problem::state::State;
use crate::control::problem::utility::RelativeUtility;
use crate::numerics::chebyshev::{Chebyshev, local_cubic};

/// Chebyshev nodes in the action. Over the action interval the log of the next wealth, which is the feature, is nearly a
/// parabola: a cubic through four nodes is good to 1e-6 of the gain.
const ACTION_NODES: usize = 4;

/// Predictions tabulated over returns and actions, for one state.
pub struct GainField<'a> {
    problem: &'a Problem,
    next: &'a NextValue,
    utility: RelativeUtility,
    wealth: f64,
    returns: Vec<f64>,
    action_nodes: Chebyshev,
    /// `table[i * nodes + m]`: the prediction at return i and action node m; empty where the gain is constant.
    table: Vec<f64>,
}

impl<'a> GainField<'a> {
    /// `returns` ascending and distinct, `utility` relative to the floor of `state`. Cost O(returns x nodes x design count).
    pub fn tabulate(
        problem: &'a Problem,
        next: &'a NextValue,
        utility: RelativeUtility,
        state: &State,
        returns: Vec<f64>,
    ) -> Self {
        let wealth_matters = next.depends_on_wealth(&problem.selection);
        let action_nodes = Chebyshev::new(if wealth_matters { ACTION_NODES } else { 1 });
        let highest = problem.actions().highest;
        let actions: Vec<f64> = action_nodes.nodes().iter().map(|share| share * highest).collect();
        let table = next.tabulate(problem, state, &returns, &actions);
        GainField { problem, next, utility, wealth: state.wealth, returns, action_nodes, table }
    }

    /// The returns at which it is exact, ascending.
    pub fn returns(&self) -> &[f64] {
        &self.returns
    }

    /// The utility relative to the floor of the state.
    pub fn utility(&self) -> RelativeUtility {
        self.utility
    }

    /// Bank return per step.
    pub fn rate_per_step(&self) -> f64 {
        self.problem.specification.problem.rate_per_step
    }

    /// Prepares evaluation at fixed returns.
    pub fn at(&self, returns: &[f64]) -> FieldRows<'_> {
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
        let excesses = returns.iter().map(|z| z.exp() / (1.0 + self.rate_per_step()) - 1.0).collect();
        FieldRows { field: self, rows, excesses }
    }
}

/// A field restricted to fixed returns.
pub struct FieldRows<'f> {
    field: &'f GainField<'f>,
    /// `rows[m * returns + k]`: the prediction at action node m and return k; empty where the gain is constant.
    rows: Vec<f64>,
    /// `e^z / (1 + r) - 1`: what a unit of allocation earns beyond the bank.
    excesses: Vec<f64>,
}

impl FieldRows<'_> {
    /// Relative utility of the next state's certainty equivalent, return by return: `u(w(a, z))`. Cost O(returns x nodes).
    pub fn payoff(&self, action: f64) -> Vec<f64> {
        let GainField { next, utility, wealth, .. } = self.field;
        // S(x, a, z) over the all-bank wealth x (1 + r).
        let relative: Vec<f64> = self.excesses.iter().map(|excess| 1.0 + action * excess).collect();
        let gains = match next.constant() {
            Some(gain) => vec![gain; relative.len()],
            None => {
                let mut gains = self.interpolated(action);
                let bank = wealth * (1.0 + self.field.rate_per_step());
                next.gains(&mut gains, relative.iter().map(|relative| bank * relative));
                gains
            }
        };
        utility.values(relative, &gains)
    }

    /// The tabulated predictions, along the action.
    fn interpolated(&self, action: f64) -> Vec<f64> {
        let count = self.excesses.len();
        let basis = self.field.action_nodes.basis(action / self.field.problem.actions().highest);
        let mut predictions = vec![0.0; count];
        for (weight, row) in basis.iter().zip(self.rows.chunks_exact(count)) {
            predictions.iter_mut().zip(row).for_each(|(prediction, value)| *prediction += weight * value);
        }
        predictions
    }
}
