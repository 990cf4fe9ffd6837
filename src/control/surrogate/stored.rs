//! Surrogates of a step, as stored.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::scaling::Scaling;
use crate::numerics::gp::Hyperparameters;

/// A fitted Gaussian process: the prediction is `offset + scale * (k(input) . weights)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredSurrogate {
    pub hyperparameters: Hyperparameters,
    /// K^-1 times the scaled targets, one a design point.
    pub weights: Vec<f64>,
    pub offset: f64,
    pub scale: f64,
}

/// Both surrogates of a step with their common design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepSurrogates {
    pub scaling: Scaling,
    /// Scaled inputs, one column a feature, one entry a design point.
    pub inputs: Vec<Vec<f64>>,
    pub value: StoredSurrogate,
    pub policy: StoredSurrogate,
    /// Largest floor gain on the design: predictions are clamped to it.
    pub largest_gain: f64,
    /// States whose predicted standard deviation of the value target exceeds this lie outside the design:
    /// the 99 % quantile of the leave-one-out deviations on the design.
    pub deviation_limit: f64,
}

/// The solution where all states of a step are one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingleSolution {
    pub floor_gain: f64,
    pub action: f64,
}

/// What a step keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Solution {
    Single(SingleSolution),
    Surrogates(Box<StepSurrogates>),
}

impl StepSurrogates {
    /// The inputs as a matrix, one row a design point.
    pub fn matrix(&self) -> DMatrix<f64> {
        let rows = self.value.weights.len();
        DMatrix::from_iterator(rows, self.inputs.len(), self.inputs.iter().flatten().copied())
    }
}
