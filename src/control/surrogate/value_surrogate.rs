//! Surrogates ready to be evaluated.

use super::features::Features;
use super::scaling::Scaling;
use super::stored::{StepSurrogates, StoredSurrogate};
use super::target::TargetMap;
use crate::control::problem::holdings::Holdings;
use crate::control::request::specification::Specification;
use crate::numerics::gp::GpMean;
use crate::numerics::statistics::summary::range;

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

/// How far beyond the inputs of the design a prediction follows them, as a share of their range. The adversary also asks
/// for values after a second leap beyond the record, of which the design has none. In a policy of 250 days on 5,000
/// returns these were off by hundreds of basis points, and the step before was so rough that 1,000 design points were
/// not enough for it; within reach 100 are.
const REACH: f64 = 0.5;

/// The value surrogate of one step.
pub struct ValueSurrogate {
    /// The scaling from features to inputs.
    pub scaling: Scaling,
    /// The surrogate of the target, not yet clamped.
    surrogate: Surrogate,
    /// The map from targets to floor gains.
    pub target: TargetMap,
    holdings: Holdings,
    /// Lower and upper end of each input; beyond them, the value is that of the nearest input within.
    reach: Vec<[f64; 2]>,
}

impl ValueSurrogate {
    /// Builds the value surrogate of a stored step.
    pub fn new(specification: &Specification, step: usize, stored: &StepSurrogates) -> Self {
        ValueSurrogate {
            scaling: stored.scaling.clone(),
            surrogate: Surrogate::new(stored, &stored.value),
            target: TargetMap::new(specification, step),
            holdings: Holdings::new(stored.value.weights.len(), specification.problem.action_interval[1]),
            reach: stored.inputs.iter().map(|column| reach(column)).collect(),
        }
    }

    /// Returns the holdings whose values are predicted.
    pub fn holdings(&self) -> Holdings {
        self.holdings
    }

    /// Returns the predicted targets at `features`, holding by holding. Cost O(N (d + holdings)).
    pub fn prediction(&self, features: &Features) -> Vec<f64> {
        self.surrogate.at(&self.within_reach(features))
    }

    /// Returns true if the first feature is an input.
    pub fn uses_first(&self) -> bool {
        self.scaling.active.first() == Some(&0)
    }

    /// Returns the input at which the value at `features` is predicted: the nearest one within reach.
    fn within_reach(&self, features: &Features) -> Vec<f64> {
        let inputs = self.scaling.apply(features).into_iter().enumerate();
        inputs.map(|(place, input)| self.nearest(place, input)).collect()
    }

    /// Returns the nearest value within reach of the input with the index `place`.
    fn nearest(&self, place: usize, input: f64) -> f64 {
        let [low, high] = self.reach[place];
        input.max(low).min(high)
    }

    /// Returns predictions that differ from `features` in the first feature alone, wealth, which must be an input:
    /// wealth by wealth, holding by holding. Cost: as [`GpMean::means_along_first`].
    pub fn predictions(&self, features: &Features, wealths: impl Iterator<Item = f64>) -> Vec<f64> {
        let input = |wealth: f64| self.nearest(0, (wealth - self.scaling.centre[0]) / self.scaling.spread[0]);
        let inputs: Vec<f64> = wealths.map(input).collect();
        self.surrogate.unscaled(self.surrogate.mean.means_along_first(&self.within_reach(features), &inputs))
    }

    /// Converts a deviation of the target to one of the floor gain, around `prediction` at total wealth. It is infinite
    /// if it leads out of the target's range.
    pub fn gain_spread(&self, prediction: f64, deviation: f64, total: f64) -> f64 {
        let gain = |target| self.target.gain(target, total);
        let spread = 0.5 * (gain(prediction + deviation) - gain(prediction - deviation)).abs();
        if spread.is_nan() { f64::INFINITY } else { spread }
    }

    /// Returns the gain of a predicted target at total wealth, between its lower bound, 0 if there is a floor, and the upper
    /// bound `largest`.
    pub fn clamped_gain(&self, prediction: f64, total: f64, [least, largest]: [f64; 2]) -> f64 {
        self.target.gain(prediction, total).clamp(least, largest.max(least))
    }
}

/// Returns the ends of an input whose values at the design points are `column`.
fn reach(column: &[f64]) -> [f64; 2] {
    let [low, high] = range(column.iter().copied());
    let beyond = REACH * (high - low);
    [low - beyond, high + beyond]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::surrogate::stored::StepSurrogates;
    use serde_json::json;

    /// Three features, the second of which is no input.
    fn surrogate() -> ValueSurrogate {
        let history = [0.01, -0.02, 0.03];
        let problem = json!({ "history": history, "rate_per_step": 0.0, "horizon": 3 });
        let specification = serde_json::from_value(json!({ "problem": problem })).unwrap();
        let scales = json!({ "lengthscales": [3.0, 2.0], "signal_variance": 1.0, "noise_variance": 1e-6 });
        let own = json!({ "hyperparameters": scales, "weights": [[0.5, -0.3, 0.2]], "offset": 0.1, "scale": 2.0 });
        let stored: StepSurrogates = serde_json::from_value(json!({
            "scaling": { "active": [0, 2], "centre": [10.0, 20.0], "spread": [2.0, 4.0] },
            "inputs": [[-1.0, 0.5, 1.0], [0.0, 4.0, -2.0]], "value": own, "policy": own, "deviation_limit": 1.0,
        }))
        .unwrap();
        ValueSurrogate::new(&specification, 1, &stored)
    }

    #[test]
    fn beyond_half_the_range_of_the_design_a_value_is_that_of_the_nearest_input() {
        let value = surrogate();
        // The inputs reach from -1 to 1 and from -2 to 4, and predictions half of that farther.
        let at = |first: f64, second: f64| Features(vec![10.0 + 2.0 * first, 0.0, 20.0 + 4.0 * second]);
        let prediction = |first: f64, second: f64| value.prediction(&at(first, second))[0];
        assert_eq!(prediction(1e6, 1.0), prediction(2.0, 1.0));
        assert_eq!(prediction(-2.5, 1.0), prediction(-2.0, 1.0));
        assert_eq!(prediction(0.3, 8.0), prediction(0.3, 7.0));
        assert_eq!(prediction(-9.0, -1e9), prediction(-2.0, -5.0));
        for (first, second) in [(1.9, 1.0), (-1.9, 1.0), (0.3, 6.9), (0.3, -4.9)] {
            let exact = value.surrogate.at(&[first, second])[0];
            assert!((prediction(first, second) - exact).abs() < 1e-12);
            assert!(prediction(first, second) != prediction(1.05 * first, 1.02 * second));
        }
        let along = value.predictions(&at(0.0, 9.0), [10.0, 14.0, 15.0, 99.0].into_iter());
        let expected = [prediction(0.0, 7.0), prediction(2.0, 7.0), prediction(2.0, 7.0), prediction(2.0, 7.0)];
        assert!(along.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12), "{along:?}");
    }
}
