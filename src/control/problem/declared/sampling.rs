//! Formulas are tried on random paths before anything is computed. A formula without a value, bounds in the wrong order
//! and a state that leaves its range are then faults of the request, with the point at which they show.

use rand::RngExt;

use super::{Declared, EarnedState};
use crate::control::error::FieldError;
use crate::control::request::declared::DeclaredProblem;
use crate::numerics::machine::streams::stream;

/// Periods that are tried.
const TRIED: usize = 10_000;
/// Share of actions and noises at either end: states go farthest there.
const AT_AN_END: f64 = 0.2;
/// Largest amount that a formula may have.
const LARGEST: f64 = 1e15;

impl Declared {
    /// Tries the formulas on random paths from the start, some of which go as far as they can. Returns the size of the
    /// amounts, and what paths earn from each step on, on average. Streams: ("declared", 0, path).
    ///
    /// # Errors
    /// The field of the formula, and the point.
    pub(super) fn sampled(&self, problem: &DeclaredProblem) -> Result<(f64, Vec<f64>), FieldError> {
        let (mut largest, mut to_come): (f64, Vec<f64>) = (0.0, vec![0.0; self.horizon]);
        let paths = TRIED.div_ceil(self.horizon);
        for path in 0..paths {
            let mut generator = stream(1, "declared", 0, path);
            // Some paths go one way all the time, and so as far as any.
            let always =
                (path % 4 == 1).then(|| [generator.random::<bool>(), generator.random::<bool>()].map(f64::from));
            let mut place = |end: usize| -> f64 {
                let even = (1.0 + 2.0 * AT_AN_END) * generator.random::<f64>() - AT_AN_END;
                always.map_or(even.clamp(0.0, 1.0), |always| always[end])
            };
            let (mut state, mut earned) = (self.start(), Vec::with_capacity(self.horizon));
            for step in 0..self.horizon {
                let [low, high] = self.checked_bounds(problem, step, &state)?;
                let action = low + place(0) * (high - low);
                let noise = self.noise[0] + place(1) * (self.noise[1] - self.noise[0]);
                let (next, reward) = self.checked_period(problem, step, &state, [action, noise])?;
                earned.push(state.earned);
                state = self.after((step, &state), [action, noise], (next, reward));
                if let Some(fault) = self.left.get() {
                    return Err(fault.clone());
                }
                largest = largest.max(reward.abs()).max(self.checked_end(problem, step + 1, &state)?);
            }
            let ended = self.ended(self.horizon, &state);
            to_come.iter_mut().zip(earned).for_each(|(sum, earned)| *sum += (ended - earned) / paths as f64);
        }
        Ok((if largest > 0.0 { largest } else { 1.0 }, to_come))
    }

    fn checked_bounds(
        &self,
        problem: &DeclaredProblem,
        step: usize,
        state: &EarnedState,
    ) -> Result<[f64; 2], FieldError> {
        let bounds = self.bounds_at(step, state);
        let (name, texts) =
            problem.actions.iter().next().map_or(("", ["", ""]), |(name, bounds)| (name, [&bounds.low, &bounds.high]));
        let at = || self.point(step, &state.values, &[]);
        for ((end, text), value) in ["low", "high"].iter().zip(texts).zip(bounds) {
            self.is_amount(&format!("problem.actions.{name}.{end}"), text, value, &at)?;
        }
        if bounds[0] > bounds[1] {
            let rule = format!("must not be below `low`; they are {} and {} at {}", bounds[1], bounds[0], at());
            return Err(FieldError::new(format!("problem.actions.{name}.high"), texts[1], rule));
        }
        Ok(bounds)
    }

    /// Checks the formulas of a period, and returns their values.
    fn checked_period(
        &self,
        problem: &DeclaredProblem,
        step: usize,
        state: &EarnedState,
        moved: [f64; 2],
    ) -> Result<(Vec<f64>, f64), FieldError> {
        let at = || self.point(step, &state.values, &moved);
        let (next, reward) = self.period(step, state, moved);
        for ((name, text), value) in problem.next.iter().zip(&next) {
            self.is_amount(&format!("problem.next.{name}"), text, *value, &at)?;
        }
        self.is_amount("problem.reward", problem.reward.as_deref().unwrap_or_default(), reward, &at)?;
        Ok((next, reward))
    }

    /// Checks the end at a state, and returns its size.
    fn checked_end(&self, problem: &DeclaredProblem, step: usize, state: &EarnedState) -> Result<f64, FieldError> {
        let end = self.at(step, &state.values, [0.0; 2], |value| value(&self.end));
        let (field, text) = match &problem.utility {
            Some(utility) => ("problem.utility.of", utility.of()),
            None => ("problem.end", problem.end.as_deref().unwrap_or_default()),
        };
        let at = || self.point(step, &state.values, &[]);
        self.is_amount(field, text, end, &at)?;
        if end <= 0.0 && self.of_ratio(1.0).is_some() {
            return Err(FieldError::new(field, text, format!("must be positive; it is {end} at {}", at())));
        }
        Ok(end.abs())
    }

    fn is_amount(&self, field: &str, text: &str, value: f64, at: &dyn Fn() -> String) -> Result<(), FieldError> {
        if value.abs() <= LARGEST {
            return Ok(());
        }
        let found = if value.is_nan() { "has no value".to_owned() } else { format!("is {value}, beyond {LARGEST:e},") };
        Err(FieldError::new(field, text, format!("{found} at {}", at())))
    }
}
