//! Rules that a user states in formulas instead of a policy.

use std::collections::BTreeMap;

use super::formula::Formula;
use super::reading::{known, parse};
use super::{Controlled, Declared, EarnedState};
use crate::control::error::FieldError;
use crate::control::problem::actions::{ActionInterval, ActionSet};

/// A formula for each action, of the states, the parameters, `t` and `T`.
#[derive(Debug, Clone)]
pub struct FormulaRule {
    /// The field of the rule.
    field: String,
    /// In the order of the actions, with the texts.
    formulas: Vec<(String, Formula)>,
}

impl Declared {
    /// Reads a rule, whose fields begin with `field`.
    ///
    /// # Errors
    /// An action without a formula, the name of no action, a formula that cannot be read.
    pub fn rule(&self, field: &str, formulas: &BTreeMap<String, String>) -> Result<FormulaRule, FieldError> {
        let named = self.actions_named();
        if let Some((other, text)) = formulas.iter().find(|(name, _)| !named.contains(name)) {
            let rule = format!("must name one of the actions: {}", named.join(", "));
            return Err(FieldError::new(format!("{field}.{other}"), text, rule));
        }
        let (states, moved) = (self.ranges.len(), self.ranges.len() + self.actions.len() + 1);
        let names = known(&self.names, states..moved);
        let read = |name: &String| {
            let field = format!("{field}.{name}");
            let text =
                formulas.get(name).ok_or_else(|| FieldError::new(&field, "", "must be given for each action"))?;
            Ok((text.clone(), parse(field, text, &names)?))
        };
        Ok(FormulaRule { field: field.to_owned(), formulas: named.iter().map(read).collect::<Result<_, _>>()? })
    }

    /// Returns the actions of a rule at a state: each is moved into its bounds, or to the nearest of its values.
    ///
    /// # Errors
    /// A formula without a value there, or with an infinite one.
    pub fn ruled(&self, rule: &FormulaRule, step: usize, state: &EarnedState) -> Result<Vec<f64>, FieldError> {
        let sets = Controlled::actions(self, step, state);
        let places = rule.formulas.iter().zip(self.actions_named()).zip(sets);
        let action = |(((text, formula), name), set): ((&(String, Formula), &String), ActionSet)| {
            let wanted = self.at(step, &state.values, None, |value| value(formula));
            if !wanted.is_finite() {
                let found = if wanted.is_nan() { "has no value".to_owned() } else { format!("is {wanted}") };
                let at = format!("{found} at {}", self.named(step, state));
                return Err(FieldError::new(format!("{}.{name}", rule.field), text, at));
            }
            Ok(match set {
                ActionSet::Interval(ActionInterval { lowest, highest }) => wanted.min(highest).max(lowest),
                ActionSet::Values(values) => {
                    let nearer = |left: &f64, right: &f64| (left - wanted).abs().total_cmp(&(right - wanted).abs());
                    values.into_iter().min_by(nearer).unwrap_or(wanted)
                }
            })
        };
        places.map(action).collect()
    }
}
