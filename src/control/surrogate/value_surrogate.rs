//! Surrogates ready to be evaluated.

use super::features::Features;
use super::scaling::Scaling;
use super::stored::{StepSurrogates, StoredSurrogate};
use super::target::TargetMap;
use crate::control::problem::holdings::Holdings;
use crate::control::request::specification::Specification;
use crate::numerics::gp::GpMean;

/// A Gaussian process of one or more functions of the inputs. The prediction of each at scaled input x is
///
///   offset + scale k(x)^T K^-1 targets.
pub struct Surrogate {
    mean: GpMean,
    offset: f64,
    scale: f64,
}

impl Surrogate {
    /// Builds one of the two surrogates of the step, `own`.
    pub fn new(step: &StepSurrogates, own: &StoredSurrogate) -> Self {
        let mean = GpMean::new(&step.matrix(), &own.weights, &own.hyperparameters);
        Surrogate { mean, offset: own.offset, scale: own.scale }
    }

    /// Returns the prediction of every function at a scaled input. Cost O(N (d + functions)).
    pub fn at(&self, input: &[f64]) -> Vec<f64> {
        self.unscaled(self.mean.means(input))
    }

    fn unscaled(&self, mut means: Vec<f64>) -> Vec<f64> {
        means.iter_mut().for_each(|mean| *mean = self.offset + self.scale * *mean);
        means
    }
}

/// The value surrogate of one step.
pub struct ValueSurrogate {
    /// The scaling from features to inputs.
    pub scaling: Scaling,
    /// The surrogate of the target, not yet clamped.
    pub surrogate: Surrogate,
    /// The map from targets to floor gains.
    pub target: TargetMap,
    holdings: Holdings,
}

impl ValueSurrogate {
    /// Builds the value surrogate of a stored step.
    pub fn new(specification: &Specification, step: usize, stored: &StepSurrogates) -> Self {
        ValueSurrogate {
            scaling: stored.scaling.clone(),
            surrogate: Surrogate::new(stored, &stored.value),
            target: TargetMap::new(specification, step),
            holdings: Holdings::new(stored.value.weights.len(), specification.problem.action_interval[1]),
        }
    }

    /// Returns the holdings whose values are predicted.
    pub fn holdings(&self) -> Holdings {
        self.holdings
    }

    /// Returns the predicted targets at `features`, holding by holding. Cost O(N (d + holdings)).
    pub fn prediction(&self, features: &Features) -> Vec<f64> {
        self.surrogate.at(&self.scaling.apply(features))
    }

    /// Returns predictions that differ from `features` in the first feature alone, wealth, which must be an input:
    /// wealth by wealth, holding by holding. Cost: as [`GpMean::means_along_first`].
    pub fn predictions(&self, features: &Features, wealths: impl Iterator<Item = f64>) -> Vec<f64> {
        let inputs = wealths.map(|wealth| (wealth - self.scaling.centre[0]) / self.scaling.spread[0]);
        let inputs: Vec<f64> = inputs.collect();
        self.surrogate.unscaled(self.surrogate.mean.means_along_first(&self.scaling.apply(features), &inputs))
    }

    /// Converts a deviation of the target to one of the floor gain, around `prediction` at total wealth. It is infinite
    /// if it leads out of the target's range.
    pub fn gain_spread(&self, prediction: f64, deviation: f64, total: f64) -> f64 {
        let gain = |target| self.target.gain(target, total);
        let spread = 0.5 * (gain(prediction + deviation) - gain(prediction - deviation)).abs();
        if spread.is_nan() { f64::INFINITY } else { spread }
    }

    /// Returns the floor gain of a predicted target at total wealth, between its lower bound 0 and the upper bound
    /// `largest`.
    pub fn clamped_gain(&self, prediction: f64, total: f64, largest: f64) -> f64 {
        self.target.gain(prediction, total).clamp(0.0, largest.max(0.0))
    }
}
