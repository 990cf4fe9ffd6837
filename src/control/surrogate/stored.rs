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
    /// For scaled inputs and targets.
    pub hyperparameters: Hyperparameters,
    /// K^-1 times the scaled targets, function by function, one a design point.
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
    /// From features to inputs.
    pub scaling: Scaling,
    /// Scaled inputs, one column a feature, one entry a design point.
    pub inputs: Vec<Vec<f64>>,
    /// Of the value target: one function, or where trading costs one for each of the [`Holdings`].
    pub value: StoredSurrogate,
    /// Of the policy target, an action: one function, or where trading costs the lower and the upper end of the band.
    pub policy: StoredSurrogate,
    /// Largest floor gain on the design: predictions are clamped to it.
    pub largest_gain: f64,
    /// States whose predicted standard deviation of the value target exceeds this, in units of the value's `scale`, lie
    /// outside the design: the 99.5 % quantile of the deviations at fresh states of the design's own law where the law is part of
    /// the state, of the leave-one-out deviations at the design points where it is not.
    pub deviation_limit: f64,
}

/// The solution where all states of a step are one, but for the holding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingleSolution {
    /// Log certainty equivalents over the all-bank floor: one, or where trading costs one for each of the [`Holdings`].
    pub floor_gains: Vec<f64>,
    /// The lowest and the highest share of wealth that is kept as it is.
    pub band: Band,
}

/// What a step keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Solution {
    /// Where all states are one.
    Single(SingleSolution),
    /// Where they differ.
    Surrogates(Box<StepSurrogates>),
}

impl Solution {
    /// Where states differ.
    pub fn surrogates(&self) -> Option<&StepSurrogates> {
        match self {
            Solution::Single(_) => None,
            Solution::Surrogates(stored) => Some(stored),
        }
    }
}

impl StepSurrogates {
    /// Design points, N.
    pub fn count(&self) -> usize {
        self.inputs.first().map_or(0, Vec::len)
    }

    /// The inputs as a matrix, one row a design point.
    pub fn matrix(&self) -> DMatrix<f64> {
        let rows = self.count();
        DMatrix::from_iterator(rows, self.inputs.len(), self.inputs.iter().flatten().copied())
    }
}
