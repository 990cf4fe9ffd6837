//! Formulas are tried on random paths before anything is computed. A formula without a value, bounds in the wrong order
//! and a state that leaves its range are then faults of the request, with the point at which they show.

use rand::RngExt;

use super::{Baseline, Controlled, Declared, EarnedState};
use crate::control::error::FieldError;
use crate::control::problem::actions::{ActionInterval, ActionSet};
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
    /// amounts, and about what paths earn from each step on. Streams: ("declared", 0, path).
    ///
    /// # Errors
    /// The field of the formula, and the point.
    pub(super) fn sampled(&self, problem: &DeclaredProblem) -> Result<(f64, Vec<Baseline>), FieldError> {
        let mut largest: f64 = 0.0;
        let (mut reached, mut to_come) = (vec![Vec::new(); self.horizon], vec![Vec::new(); self.horizon]);
        let paths = TRIED.div_ceil(self.horizon);
        for path in 0..paths {
            let mut generator = stream(1, "declared", 0, path);
            // Some paths go one way all the time, and so as far as any.
            let mut end = || f64::from(generator.random::<bool>());
            let always: Option<Vec<f64>> = (path % 4 == 1).then(|| (0..=self.actions.len()).map(|_| end()).collect());
            let mut place = |index: usize| -> f64 {
                let even = (1.0 + 2.0 * AT_AN_END) * generator.random::<f64>() - AT_AN_END;
                always.as_ref().map_or(even.clamp(0.0, 1.0), |always| always[index])
            };
            let (mut state, mut earned) = (self.start(), Vec::with_capacity(self.horizon));
            for (step, reached) in reached.iter_mut().enumerate() {
                let sets = self.checked_actions(problem, step, &state)?;
                let actions: Vec<f64> = sets.iter().enumerate().map(|(index, set)| set.at(place(index))).collect();
                let moved = (actions.as_slice(), self.noise(place(actions.len()) - 0.5));
                let (next, reward) = self.checked_period(problem, step, &state, moved)?;
                earned.push(state.earned);
                reached.push(state.values.clone());
                state = self.after((step, &state), moved, (next, reward));
                if let Some(fault) = self.left.get() {
                    return Err(fault.clone());
                }
                largest = largest.max(reward.abs()).max(self.checked_end(problem, step + 1, &state)?);
            }
            let ended = self.ended(self.horizon, &state);
            to_come.iter_mut().zip(earned).for_each(|(worths, earned)| worths.push(ended - earned));
        }
        let baselines = reached.iter().zip(&to_come).map(|(states, worths)| Baseline::fitted(states, worths));
        Ok((if largest > 0.0 { largest } else { 1.0 }, baselines.collect()))
    }

    fn checked_actions(
        &self,
        problem: &DeclaredProblem,
        step: usize,
        state: &EarnedState,
    ) -> Result<Vec<ActionSet>, FieldError> {
        let sets = Controlled::actions(self, step, state);
        let at = || self.point(step, &state.values, None);
        for ((name, action), set) in problem.actions.iter().zip(&sets) {
            let ActionSet::Interval(ActionInterval { lowest, highest }) = set else { continue };
            let [low, high] = [&action.low, &action.high].map(|text| text.as_deref().unwrap_or_default());
            self.is_amount(&format!("problem.actions.{name}.low"), low, *lowest, &at)?;
            self.is_amount(&format!("problem.actions.{name}.high"), high, *highest, &at)?;
            if lowest > highest {
                let rule = format!("must not be below `low`; they are {highest} and {lowest} at {}", at());
                return Err(FieldError::new(format!("problem.actions.{name}.high"), high, rule));
            }
        }
        Ok(sets)
    }

    /// Checks the formulas of a period, and returns their values.
    fn checked_period(
        &self,
        problem: &DeclaredProblem,
        step: usize,
        state: &EarnedState,
        moved: (&[f64], f64),
    ) -> Result<(Vec<f64>, f64), FieldError> {
        let at = || self.point(step, &state.values, Some(moved));
        let (next, reward) = self.period(step, state, moved);
        for ((name, text), value) in problem.next.iter().zip(&next) {
            self.is_amount(&format!("problem.next.{name}"), text, *value, &at)?;
        }
        self.is_amount("problem.reward", problem.reward.as_deref().unwrap_or_default(), reward, &at)?;
        Ok((next, reward))
    }

    /// Checks the end at a state, and returns its size.
    fn checked_end(&self, problem: &DeclaredProblem, step: usize, state: &EarnedState) -> Result<f64, FieldError> {
        let end = self.at(step, &state.values, None, |value| value(&self.end));
        let (field, text) = match &problem.utility {
            Some(utility) => ("problem.utility.of", utility.of()),
            None => ("problem.end", problem.end.as_deref().unwrap_or_default()),
        };
        let at = || self.point(step, &state.values, None);
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
