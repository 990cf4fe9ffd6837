//! Surrogates of a step, as stored and as evaluated.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::features::{FeatureSelection, Scaling};
use super::specification::{Specification, SurrogateTarget, UtilitySpecification};
use super::state::{State, floor};
use super::utility::{certainty_equivalent, depends_on_wealth, utility};
use crate::numerics::gp::{GpMean, Hyperparameters};

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

/// How the value target of a step maps to and from the floor gain.
#[derive(Debug, Clone, Copy)]
pub struct TargetMap {
    target: SurrogateTarget,
    utility: UtilitySpecification,
    rate_per_step: f64,
    steps_left: usize,
}

impl TargetMap {
    pub fn new(specification: &Specification, step: usize) -> Self {
        TargetMap {
            target: specification.surrogate.target,
            utility: specification.problem.utility,
            rate_per_step: specification.problem.rate_per_step,
            steps_left: specification.problem.horizon - step,
        }
    }

    /// Terminal all-bank wealth in whose units the value is taken: of unit wealth where wealth does not matter.
    fn floor(&self, wealth: f64) -> f64 {
        let wealth = if depends_on_wealth(self.utility) { wealth } else { 1.0 };
        floor(wealth, self.rate_per_step, self.steps_left)
    }

    pub fn is_value(&self) -> bool {
        self.target == SurrogateTarget::Value
    }

    /// The regression target at a state with `wealth` and this floor gain.
    pub fn target(&self, gain: f64, wealth: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => gain,
            SurrogateTarget::Value => utility(self.utility, self.floor(wealth) * gain.exp()),
        }
    }

    /// The floor gain behind a predicted target, not clamped.
    pub fn gain(&self, target: f64, wealth: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => target,
            SurrogateTarget::Value => {
                let gain = (certainty_equivalent(self.utility, target) / self.floor(wealth)).ln();
                // A prediction beyond the utility's range has no certainty equivalent.
                if gain.is_nan() { f64::INFINITY } else { gain }
            }
        }
    }
}

/// The value of the step after, ready to be evaluated.
pub enum NextValue {
    /// The horizon: no gain over the wealth reached.
    Terminal,
    /// The same floor gain everywhere.
    Constant(f64),
    Surrogate(Box<ValueSurrogate>),
    /// The floor gain itself, however it is known: what a surrogate is measured against.
    Exact(Box<dyn Fn(&State) -> f64 + Send + Sync>),
}

/// The value surrogate of one step.
pub struct ValueSurrogate {
    pub scaling: Scaling,
    pub mean: GpMean,
    pub offset: f64,
    pub scale: f64,
    pub largest_gain: f64,
    pub target: TargetMap,
}

impl ValueSurrogate {
    pub fn new(stored: &StepSurrogates, target: TargetMap) -> Self {
        ValueSurrogate {
            scaling: stored.scaling.clone(),
            mean: GpMean::new(&stored.matrix(), &stored.value.weights, &stored.value.hyperparameters),
            offset: stored.value.offset,
            scale: stored.value.scale,
            largest_gain: stored.largest_gain,
            target,
        }
    }

    /// The deviation of the floor gain that a deviation of the target makes, around `prediction` at `wealth`; the
    /// largest gain where it leads out of the target's range.
    pub fn gain_spread(&self, prediction: f64, deviation: f64, wealth: f64) -> f64 {
        let gain = |target| self.target.gain(target, wealth);
        let spread = 0.5 * (gain(prediction + deviation) - gain(prediction - deviation)).abs();
        if spread.is_finite() { spread } else { self.largest_gain }
    }

    /// The floor gain of a predicted target at `wealth`, clamped to what is true (0) and seen (the largest).
    pub fn clamped_gain(&self, prediction: f64, wealth: f64) -> f64 {
        self.target.gain(prediction, wealth).clamp(0.0, self.largest_gain)
    }
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
}

/// True where the selection leaves the wealth feature active in this scaling.
pub fn wealth_is_active(selection: &FeatureSelection, scaling: &Scaling) -> bool {
    selection.has_wealth() && scaling.active.first() == Some(&0)
}
