//! A rough worth of a state: a linear function of its numbers, fitted to random paths. Surrogates learn what a value
//! differs from it by.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Least number of paths for each coefficient. With fewer the worth is their mean.
const PATHS_EACH: usize = 20;
/// A state whose spread is less than this share of its size differs by rounding alone.
const ROUNDING: f64 = 1e-12;
/// Directions of the states in which paths differ by less than this share of the widest are left out.
const NARROW: f64 = 1e-6;

/// The constant plus the sum of each slope times the number of the state at its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// The constant.
    pub constant: f64,
    /// In the order of the states' names.
    pub slopes: Vec<f64>,
}

impl Baseline {
    /// Returns the worth of a state.
    pub fn at(&self, state: &[f64]) -> f64 {
        self.constant + self.slopes.iter().zip(state).map(|(slope, value)| slope * value).sum::<f64>()
    }

    /// Fits the worths found from some states by least squares. Where the states do not differ, slopes are 0.
    pub fn fitted(states: &[Vec<f64>], worths: &[f64]) -> Self {
        let (paths, count) = (states.len(), states[0].len());
        let mean = |of: &dyn Fn(usize) -> f64| (0..paths).map(of).sum::<f64>() / paths as f64;
        let (centre, level) = (
            (0..count).map(|place| mean(&|path| states[path][place])).collect::<Vec<f64>>(),
            mean(&|path| worths[path]),
        );
        let flat = Baseline { constant: level, slopes: vec![0.0; count] };
        let spread = |place: usize| {
            let spread = mean(&|path| (states[path][place] - centre[place]).powi(2)).sqrt();
            if spread > ROUNDING * centre[place].abs() { spread } else { 0.0 }
        };
        let spread: Vec<f64> = (0..count).map(spread).collect();
        if paths < PATHS_EACH * (count + 1) || spread.iter().all(|spread| *spread == 0.0) {
            return flat;
        }
        let scaled = |path: usize, place: usize| match spread[place] {
            0.0 => 0.0,
            spread => (states[path][place] - centre[place]) / spread,
        };
        let matrix = DMatrix::from_fn(paths, count, scaled);
        let found = matrix.svd(true, true);
        let least = NARROW * found.singular_values.max();
        let Ok(slopes) = found.solve(&DVector::from_fn(paths, |path, _| worths[path] - level), least) else {
            return flat;
        };
        let slopes: Vec<f64> = slopes
            .iter()
            .zip(&spread)
            .map(|(slope, spread)| if *spread > 0.0 { slope / spread } else { 0.0 })
            .collect();
        let constant = level - slopes.iter().zip(&centre).map(|(slope, centre)| slope * centre).sum::<f64>();
        Baseline { constant, slopes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_worth_is_found_again() {
        let states: Vec<Vec<f64>> =
            (0..100).map(|path| vec![f64::from(path % 7), 0.1, 1e4 + f64::from(path % 11)]).collect();
        let worths: Vec<f64> = states.iter().map(|state| 2.0 - 0.5 * state[0] + 3.0 * state[2]).collect();
        let baseline = Baseline::fitted(&states, &worths);
        assert_eq!(baseline.slopes[1], 0.0);
        for (state, worth) in states.iter().zip(&worths) {
            assert!((baseline.at(state) - worth).abs() < 1e-7, "{baseline:?}");
        }
        let few = Baseline::fitted(&states[..70], &worths[..70]);
        assert_eq!(few.slopes, [0.0; 3]);
    }
}
