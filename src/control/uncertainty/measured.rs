//! Laws of the states of a design, summed up once for several trainings: they follow from the history, the seed and the number
//! of steps, whatever the level, and radii of one law at several levels follow from the same simulated paths.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A step and some states of it.
pub type Part = (usize, Range<usize>);

/// Something at each level of a state, state by state, once it is found.
type AtLevels<T> = Arc<OnceLock<Vec<Vec<T>>>>;

/// What trainings of one history, horizon, design and seed sum up in common; the default is for a training by itself.
pub struct Measured<T> {
    /// Their levels.
    alphas: Vec<f64>,
    known: Mutex<HashMap<Part, AtLevels<T>>>,
}

impl<T> Default for Measured<T> {
    fn default() -> Self {
        Measured { alphas: Vec::new(), known: Mutex::default() }
    }
}

impl<T: Copy> Measured<T> {
    /// For trainings at these levels.
    pub fn at(alphas: Vec<f64>) -> Self {
        Measured { alphas, known: Mutex::default() }
    }

    /// What `measure` finds at level `alpha` of the states of a part, state by state; the same to the last bit whoever else
    /// asks. Trainings at one of several levels find those of all.
    pub fn level(&self, alpha: f64, part: Part, measure: impl FnOnce(&[f64]) -> Vec<Vec<T>>) -> Vec<T> {
        let level = self.alphas.iter().position(|other| *other == alpha).filter(|_| self.alphas.len() > 1);
        let Some(level) = level else { return measure(&[alpha]).concat() };
        let found = {
            let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            known.entry(part).or_default().clone()
        };
        found.get_or_init(|| measure(&self.alphas)).iter().map(|levels| levels[level]).collect()
    }
}
