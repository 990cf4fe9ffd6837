//! Surrogates of a step, as stored.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::scaling::Scaling;
use crate::control::problem::actions::Band;
#[cfg(doc)]
use crate::control::problem::holdings::Holdings;
use crate::numerics::gp::Hyperparameters;

/// A fitted Gaussian process of one or more functions of the inputs: the prediction of function i is
/// `offset + scale * (k(input) . weights[i])`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredSurrogate {
    /// Hyperparameters for scaled inputs and targets.
    pub hyperparameters: Hyperparameters,
    /// K^-1 times the scaled targets, function by function, one entry for each design point.
    pub weights: Vec<Vec<f64>>,
    /// In the target's unit.
    pub offset: f64,
    /// In the target's unit.
    pub scale: f64,
}

/// Both surrogates of a step with their common design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepSurrogates {
    /// The scaling from features to inputs.
    pub scaling: Scaling,
    /// Scaled inputs, one column for each feature, one entry for each design point.
    pub inputs: Vec<Vec<f64>>,
    /// The surrogate of the value target: one function, or one for each of the [`Holdings`] if trading costs.
    pub value: StoredSurrogate,
    /// The surrogate of the policy target, an action: one function, or the lower and the upper end of the band if
    /// trading costs.
    pub policy: StoredSurrogate,
    /// The guard: states whose predicted standard deviation of the value target exceeds this, in units of the value's
    /// `scale`, lie outside the design. It is the 99.5 % quantile of the deviations at fresh states of the design's own
    /// law, if the law is part of the state. Otherwise it is that quantile of the leave-one-out deviations at up to 500
    /// design points.
    pub deviation_limit: f64,
}

/// The solution of a step with a single state, up to the holding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingleSolution {
    /// Log certainty equivalents over the all-bank floor: one, or one for each of the [`Holdings`] if trading costs.
    pub floor_gains: Vec<f64>,
    /// The no-trade region: the lowest and the highest share of wealth that is kept as it is.
    pub band: Band,
}

/// The stored solution of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Solution {
    /// The solution of a step whose states are all the same.
    Single(SingleSolution),
    /// The surrogates of a step whose states differ.
    Surrogates(Box<StepSurrogates>),
}

impl Solution {
    /// Returns the surrogates, if the states differ.
    pub fn surrogates(&self) -> Option<&StepSurrogates> {
        match self {
            Solution::Single(_) => None,
            Solution::Surrogates(stored) => Some(stored),
        }
    }
}

impl StepSurrogates {
    /// Returns N, the number of design points.
    pub fn count(&self) -> usize {
        self.inputs.first().map_or(0, Vec::len)
    }

    /// Returns the inputs as a matrix, one row for each design point.
    pub fn matrix(&self) -> DMatrix<f64> {
        let rows = self.count();
        DMatrix::from_iterator(rows, self.inputs.len(), self.inputs.iter().flatten().copied())
    }
}
