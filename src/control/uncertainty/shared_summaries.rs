//! Laws of the states of a design, summed up once for several trainings. They follow from the history, the seed and the
//! number of steps, at any level, and radii of one law at several levels follow from the same simulated paths.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A step and some of its states.
pub type StepPart = (usize, Range<usize>);

/// A value at each level of a state, state by state, once it is computed.
type AtLevels<T> = Arc<OnceLock<Vec<Vec<T>>>>;

/// The shared summaries of trainings with one history, horizon, design and seed; the default is for a single training.
pub struct SharedSummaries<T> {
    /// Levels of the trainings.
    alphas: Vec<f64>,
    known: Mutex<HashMap<StepPart, AtLevels<T>>>,
}

impl<T> Default for SharedSummaries<T> {
    fn default() -> Self {
        SharedSummaries { alphas: Vec::new(), known: Mutex::default() }
    }
}

impl<T: Copy> SharedSummaries<T> {
    /// Shares the summaries among trainings at these levels.
    pub fn at(alphas: Vec<f64>) -> Self {
        SharedSummaries { alphas, known: Mutex::default() }
    }

    /// Returns the result of `measure` at level `alpha` for the states of a part, state by state. The result is the
    /// same to the last bit for any set of sharing trainings. A training at one of several levels computes those of
    /// all.
    pub fn level(&self, alpha: f64, part: StepPart, measure: impl FnOnce(&[f64]) -> Vec<Vec<T>>) -> Vec<T> {
        let level = self.alphas.iter().position(|other| *other == alpha).filter(|_| self.alphas.len() > 1);
        let Some(level) = level else { return measure(&[alpha]).concat() };
        let found = {
            let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            known.entry(part).or_default().clone()
        };
        found.get_or_init(|| measure(&self.alphas)).iter().map(|levels| levels[level]).collect()
    }
}
