//! The periods that are lived: states and executed actions by their names, and where they lead.

use std::collections::BTreeMap;

use super::{Declared, EarnedState};
use crate::control::error::FieldError;
use crate::control::problem::controlled::Controlled;
use crate::control::request::bounds::within;
use crate::control::request::by_name::by_name;

impl Declared {
    /// Reads a state by the names of its numbers, before which nothing was earned.
    ///
    /// # Errors
    /// A name without a number, another name, a number out of its range.
    pub fn state(&self, field: &str, state: &BTreeMap<String, f64>) -> Result<EarnedState, FieldError> {
        let names = self.states_named();
        let values = by_name(field, "state", state, names)?;
        for ((name, value), [low, high]) in names.iter().zip(&values).zip(&self.ranges) {
            within(&format!("{field}.{name}"), *value, *low, *high)?;
        }
        Ok(EarnedState { values, earned: 0.0 })
    }

    /// Returns the values of the states by name.
    pub fn states_by_name(&self, state: &EarnedState) -> BTreeMap<String, f64> {
        self.states_named().iter().cloned().zip(state.values.iter().copied()).collect()
    }

    /// Returns actions by name, of which all are given in the order of their names.
    pub fn actions_by_name(&self, actions: &[f64]) -> BTreeMap<String, f64> {
        self.actions_named().iter().cloned().zip(actions.iter().copied()).collect()
    }

    /// Returns what a state is worth at the end, or with a utility its amount.
    pub fn end_worth(&self, state: &EarnedState) -> f64 {
        self.at(self.horizon, &state.values, None, |value| value(&self.end))
    }

    /// Reads executed actions by name, in the order of the names.
    ///
    /// # Errors
    /// An action without a number, another name; unless they are `recorded`, a number that the action may not be in the
    /// state after `step` periods.
    pub fn executed(
        &self,
        field: &str,
        (step, state): (usize, &EarnedState),
        executed: &BTreeMap<String, f64>,
        recorded: bool,
    ) -> Result<Vec<f64>, FieldError> {
        let names = self.actions_named();
        let actions = by_name(field, "action", executed, names)?;
        if !recorded {
            for ((name, action), set) in names.iter().zip(&actions).zip(self.actions(step, state)) {
                set.checked(&format!("{field}.{name}"), *action)?;
            }
        }
        Ok(actions)
    }

    /// Returns the values of the states after a period with these actions and a noise in the unit of the solver, unless
    /// one leaves its range, and what the period earned, unless that is no number.
    pub fn passed(
        &self,
        step: usize,
        state: &EarnedState,
        actions: &[f64],
        scaled: f64,
    ) -> (Result<Vec<f64>, FieldError>, Result<f64, FieldError>) {
        let problem = self.afresh();
        let moved = (actions, problem.noise(scaled));
        let (values, reward) = problem.period(step, state, moved);
        let next = problem.after((step, state), moved, (values, reward)).values;
        let earned = match reward.is_finite() {
            true => Ok(reward),
            false => {
                let rule =
                    format!("must be a number; it is not at {}", problem.point(step, &state.values, Some(moved)));
                Err(FieldError::new("problem.reward", reward, rule))
            }
        };
        (problem.fault().map_or(Ok(next), |fault| Err(fault.clone())), earned)
    }
}
