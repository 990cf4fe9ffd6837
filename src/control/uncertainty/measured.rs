//! Radii of the states of a design, found once for several trainings: the states follow from the history, the seed and the
//! number of steps, and radii of one law at several levels from the same simulated paths.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::radius::{Radii, RadiusEstimator};
use crate::control::problem::state::State;

/// A step and some states of it.
pub type Part = (usize, Range<usize>);

/// Radii at each level of a state, state by state, once they are found.
type AtLevels = Arc<OnceLock<Vec<Vec<Radii>>>>;

/// What trainings of one history, horizon, design and seed measure in common; the default is for a training by itself.
#[derive(Default)]
pub struct Measured {
    /// Their levels.
    alphas: Vec<f64>,
    known: Mutex<HashMap<Part, AtLevels>>,
}

impl Measured {
    /// For trainings at these levels.
    pub fn at(alphas: Vec<f64>) -> Self {
        Measured { alphas, ..Measured::default() }
    }

    /// Radii at level `alpha` of `states`, those of a step in a range of the design; the same to the last bit whoever else
    /// asks. Trainings at one of several levels find those of all.
    pub fn radii(&self, alpha: f64, part: Part, sets: &RadiusEstimator, states: &[State]) -> Vec<Radii> {
        let laws: Vec<_> = states.iter().map(|state| &state.law).collect();
        let level = self.alphas.iter().position(|other| *other == alpha).filter(|_| self.alphas.len() > 1);
        let Some(level) = level else { return sets.radii_of(&laws, &[alpha]).concat() };
        let found = {
            let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            known.entry(part).or_default().clone()
        };
        found.get_or_init(|| sets.radii_of(&laws, &self.alphas)).iter().map(|levels| levels[level]).collect()
    }
}
