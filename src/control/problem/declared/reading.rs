//! A declaration is read once: every name, number and formula is checked before anything is computed.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::OnceLock;

use super::formula::{FUNCTIONS, Formula};
use super::{Action, Declared};
use crate::control::error::FieldError;
use crate::control::request::bounds::{whole, within};
use crate::control::request::centre::CentreSpecification;
use crate::control::request::completion::DEFAULT_COUNT;
use crate::control::request::declared::{
    DeclaredAction, DeclaredDesign, DeclaredProblem, DeclaredSpecification, DeclaredUtility,
};
use crate::control::request::framework::Framework;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::radius_rules::{FIXED_RADIUS, KAPPA};
use crate::control::request::rules::{ACCURACY, HORIZON};
use crate::control::request::specification::{
    DesignSpecification, ProblemSpecification, Specification, UtilitySpecification,
};
use crate::control::request::support::Support;

/// Most states of a problem.
const MOST_STATES: usize = 6;
/// Most actions, and most choices of all that have values.
const MOST_ACTIONS: usize = 3;
const MOST_CHOICES: usize = 64;
/// Most parameters.
const MOST_PARAMETERS: usize = 100;
/// Largest number that may be declared.
const LARGEST: f64 = 1e12;
/// Most letters of a name.
const MOST_LETTERS: usize = 40;

impl Declared {
    /// Reads a declaration. Cost: its formulas at 10,000 points.
    ///
    /// # Errors
    /// The first field that breaks a rule. For a formula the rule begins with its column.
    pub fn new(problem: &DeclaredProblem) -> Result<Declared, FieldError> {
        let mut declared = Declared::parsed(problem)?;
        history(problem)?;
        (declared.unit, declared.baselines) = declared.sampled(problem)?;
        Ok(declared)
    }

    /// Reads a declaration that was read before, with or without its history. It moves states, but is not for training.
    ///
    /// # Errors
    /// As [`Self::new`], but for its history and for what only a trial of the formulas shows.
    pub fn parsed(problem: &DeclaredProblem) -> Result<Declared, FieldError> {
        let names = names(problem)?;
        numbers(problem)?;
        let (states, moved) = (problem.states.len(), problem.states.len() + problem.actions.len() + 1);
        let (of_state, of_all) = (known(&names, states..moved), known(&names, states..states));
        let action = |(name, action): (&String, &DeclaredAction)| {
            action.read(name, |end, text| parse(format!("problem.actions.{name}.{end}"), text, &of_state))
        };
        let next = |state: &String| {
            let field = format!("problem.next.{state}");
            let text =
                problem.next.get(state).ok_or_else(|| FieldError::new(&field, "", "must be given for each state"))?;
            parse(field, text, &of_all)
        };
        let (field, end) = match (&problem.utility, &problem.end) {
            (None, Some(end)) => ("problem.end", end.as_str()),
            (None, None) if problem.reward.is_none() => {
                return Err(FieldError::new("problem.end", "", "must be given without a reward and a utility"));
            }
            (None, None) => ("problem.end", "0"),
            (Some(utility), None) => ("problem.utility.of", utility.of()),
            (Some(_), Some(end)) => {
                return Err(FieldError::new(
                    "problem.end",
                    end,
                    "must be absent with a utility, which has its own amount",
                ));
            }
        };
        if let (Some(_), Some(reward)) = (&problem.utility, &problem.reward) {
            let rule = "must be absent with a utility, which is of the amount at the end alone";
            return Err(FieldError::new("problem.reward", reward, rule));
        }
        Ok(Declared {
            ranges: problem.states.values().map(|state| [state.low, state.high]).collect(),
            start: problem.states.values().map(|state| state.start).collect(),
            parameters: problem.parameters.values().copied().collect(),
            actions: problem.actions.iter().map(action).collect::<Result<_, _>>()?,
            next: problem.states.keys().map(next).collect::<Result<_, _>>()?,
            reward: problem.reward.as_deref().map(|text| parse("problem.reward".into(), text, &of_all)).transpose()?,
            end: parse(field.into(), end, &of_state)?,
            utility: problem.utility.as_ref().map(DeclaredUtility::specification),
            discount: problem.discount,
            horizon: problem.horizon,
            noise: [problem.noise.low, problem.noise.high],
            unit: 1.0,
            baselines: Vec::new(),
            left: OnceLock::new(),
            names: names.clone(),
        })
    }

    /// Returns an accuracy of the worth as one of gains, in ten-thousandths.
    fn accuracy(&self, accuracy: f64) -> Result<f64, FieldError> {
        let amount = |of_gains| self.error_amount(of_gains, self.ended(0, &self.start()));
        let of_gains = accuracy / amount(1.0);
        let (least, most) = ACCURACY;
        // The next policy of a life that grew or shrank is asked for the same amount, of which more may be too much.
        if of_gains >= least {
            return Ok(of_gains.min(most));
        }
        let least = amount(least);
        Err(FieldError::new(
            "design.accuracy",
            accuracy,
            format!("must be {least} at least, by the size of the amounts"),
        ))
    }

    /// Returns what the solver of controlled problems needs to know: the noise in its unit, and the settings.
    ///
    /// # Errors
    /// A number of design points, or a rule for the radius, that this problem cannot have.
    pub fn specification(&self, declared: &DeclaredSpecification) -> Result<Specification, FieldError> {
        let problem = &declared.problem;
        let [low, high] = self.noise;
        let radius = problem.radius.map(|rule| match rule {
            RadiusRule::RootN { kappa } => RadiusRule::RootN { kappa: kappa / (high - low) },
            RadiusRule::Fixed { radius } => RadiusRule::Fixed { radius: radius / (high - low) },
            rule => rule,
        });
        if let Some(rule @ RadiusRule::ChiSquare { .. }) = radius {
            let rule = rule.name();
            return Err(FieldError::new(
                "problem.radius.rule",
                rule,
                "must be bridge, calibrated, joint, concentration, root_n or fixed",
            ));
        }
        let mut investor =
            ProblemSpecification::of(problem.history.iter().map(|noise| self.scaled(*noise)).collect(), 0.0);
        investor.framework = problem.framework;
        investor.horizon = problem.horizon;
        investor.learning = problem.learning;
        investor.centre = CentreSpecification::default();
        investor.radius = radius;
        investor.support = Some(Support::Between { min: -0.5, max: 0.5 });
        let DeclaredDesign { accuracy, count } = declared.design;
        let accuracy = accuracy.map(|accuracy| self.accuracy(accuracy)).transpose()?;
        let count = Some(count.unwrap_or(DEFAULT_COUNT));
        let design = DesignSpecification { accuracy, count, ..DesignSpecification::default() };
        let surrogate = declared.surrogate.clone();
        Ok(Specification { design, surrogate, ..Specification::of(investor, declared.seed) })
    }
}

/// Returns the names that a formula may use, in the order of their values. Those of the places `unknown` are empty: a
/// formula may not use what is not known where it is evaluated.
pub(super) fn known(names: &[String], unknown: Range<usize>) -> Vec<&str> {
    names.iter().enumerate().map(|(place, name)| if unknown.contains(&place) { "" } else { name }).collect()
}

/// Parses the formula of a field.
pub(super) fn parse(field: String, text: &str, names: &[&str]) -> Result<Formula, FieldError> {
    Formula::parse(text, names).map_err(|fault| FieldError::new(field, text, fault.to_string()))
}

impl DeclaredAction {
    /// Reads what the action may be; `bound` parses the formula of one end.
    fn read(
        &self,
        name: &str,
        bound: impl Fn(&str, &str) -> Result<Formula, FieldError>,
    ) -> Result<Action, FieldError> {
        match (&self.low, &self.high, &self.values) {
            (Some(low), Some(high), None) => Ok(Action::Bounds([bound("low", low)?, bound("high", high)?])),
            (None, None, Some(values)) => Ok(Action::Values(values.clone())),
            (low, high, values) => {
                let given = [("low", low.is_some()), ("high", high.is_some()), ("values", values.is_some())];
                let given: Vec<&str> = given.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
                let rule = "must have `low` and `high`, or `values`";
                Err(FieldError::new(format!("problem.actions.{name}"), given.join(", "), rule))
            }
        }
    }
}

impl DeclaredUtility {
    fn specification(&self) -> UtilitySpecification {
        match *self {
            DeclaredUtility::Exponential { risk_aversion, .. } => UtilitySpecification::exponential(risk_aversion),
            DeclaredUtility::Power { risk_aversion, .. } => UtilitySpecification::Power { risk_aversion },
            DeclaredUtility::Log { .. } => UtilitySpecification::Log {},
        }
    }
}

/// Returns the names that formulas may use, in the order of their values. All are different.
fn names(problem: &DeclaredProblem) -> Result<Vec<String>, FieldError> {
    counted("problem.states", problem.states.len(), 1, MOST_STATES)?;
    counted("problem.actions", problem.actions.len(), 1, MOST_ACTIONS)?;
    counted("problem.parameters", problem.parameters.len(), 0, MOST_PARAMETERS)?;
    if let Some(unknown) = problem.next.keys().find(|name| !problem.states.contains_key(*name)) {
        return Err(FieldError::new(format!("problem.next.{unknown}"), unknown, "must be the name of a state"));
    }
    let of = |field: &'static str, names: Vec<&String>| -> Vec<(&'static str, String)> {
        names.into_iter().map(|name| (field, name.clone())).collect()
    };
    let mut all = of("problem.states", problem.states.keys().collect());
    all.extend(of("problem.actions", problem.actions.keys().collect()));
    all.push(("problem.noise.name", problem.noise.name.clone()));
    all.extend(["t", "T"].map(|name| ("", name.to_owned())));
    all.extend(of("problem.parameters", problem.parameters.keys().collect()));
    let mut known: BTreeMap<&str, &str> = BTreeMap::new();
    // `t` and `T` come first, so the other use of the name is at fault.
    known.extend([("t", "the period"), ("T", "the horizon")]);
    for (field, name) in all.iter().filter(|(field, _)| !field.is_empty()) {
        let mut letters = name.chars();
        let is_name = letters.next().is_some_and(|first| first.is_alphabetic() || first == '_')
            && letters.all(|letter| letter.is_alphanumeric() || letter == '_')
            && name.chars().count() <= MOST_LETTERS;
        if !is_name {
            let rule = format!("must be a letter and then letters, digits or `_`, at most {MOST_LETTERS} in all");
            return Err(FieldError::new(*field, name, rule));
        }
        if FUNCTIONS.contains(&name.as_str()) {
            return Err(FieldError::new(*field, name, "must not be the name of a function"));
        }
        if let Some(other) = known.insert(name, field) {
            return Err(FieldError::new(*field, name, format!("must not be a name of {other} too")));
        }
    }
    Ok(all.into_iter().map(|(_, name)| name).collect())
}

fn counted(field: &str, count: usize, least: usize, most: usize) -> Result<(), FieldError> {
    let rule = || if least == most { format!("must have {least}") } else { format!("must have {least} to {most}") };
    if (least..=most).contains(&count) { Ok(()) } else { Err(FieldError::new(field, count, rule())) }
}

/// Checks the noises that are known.
fn history(problem: &DeclaredProblem) -> Result<(), FieldError> {
    let noise = &problem.noise;
    for (index, value) in problem.history.iter().enumerate() {
        if !(noise.low..=noise.high).contains(value) {
            let rule = format!("must be from `noise.low`, {}, to `noise.high`, {}", noise.low, noise.high);
            return Err(FieldError::new(format!("problem.history[{index}]"), value, rule));
        }
    }
    if problem.history.windows(2).all(|pair| pair[0] == pair[1]) {
        let found = problem.history.first().map_or("no values".to_owned(), |value| format!("{value} alone"));
        return Err(FieldError::new("problem.history", found, "must have two different values at least"));
    }
    Ok(())
}

/// Checks the numbers.
fn numbers(problem: &DeclaredProblem) -> Result<(), FieldError> {
    let range = |field: String, low: f64, high: f64| {
        is_number(format!("{field}.low"), low)?;
        is_number(format!("{field}.high"), high)?;
        // A range that rounding could close.
        let least = 1e-9 * low.abs().max(high.abs());
        if high - low > least {
            Ok(())
        } else {
            Err(FieldError::new(format!("{field}.high"), high, format!("must be above `low`, {low}")))
        }
    };
    for (name, state) in &problem.states {
        let field = format!("problem.states.{name}");
        range(field.clone(), state.low, state.high)?;
        if !(state.low..=state.high).contains(&state.start) {
            let rule = format!("must be from `low`, {}, to `high`, {}", state.low, state.high);
            return Err(FieldError::new(format!("{field}.start"), state.start, rule));
        }
    }
    let noise = &problem.noise;
    range("problem.noise".into(), noise.low, noise.high)?;
    sizes(problem)?;
    choices(problem)?;
    for (name, value) in &problem.parameters {
        is_number(format!("problem.parameters.{name}"), *value)?;
    }
    if !(problem.discount > 0.0 && problem.discount <= 1.0) {
        return Err(FieldError::new("problem.discount", problem.discount, "must be above 0 and at most 1"));
    }
    if problem.utility.is_some() && problem.discount != 1.0 {
        let rule = "must be absent with a utility, which is of the amount at the end";
        return Err(FieldError::new("problem.discount", problem.discount, rule));
    }
    match problem.utility {
        Some(DeclaredUtility::Exponential { risk_aversion, .. })
            if !(risk_aversion > 0.0 && risk_aversion <= LARGEST) =>
        {
            Err(FieldError::new("problem.utility.risk_aversion", risk_aversion, "must be above 0"))
        }
        Some(DeclaredUtility::Power { risk_aversion, .. }) if !(risk_aversion > 1.0 && risk_aversion <= 100.0) => {
            Err(FieldError::new("problem.utility.risk_aversion", risk_aversion, "must be above 1 and at most 100"))
        }
        _ if !matches!(problem.framework, Framework::Adaptive | Framework::Static | Framework::PlugIn) => {
            Err(FieldError::new("problem.framework", problem.framework.name(), "must be adaptive, static or plug_in"))
        }
        _ => Ok(()),
    }
}

fn is_number(field: String, value: f64) -> Result<(), FieldError> {
    match value.abs() <= LARGEST {
        true => Ok(()),
        false => Err(FieldError::new(field, value, format!("must be a number from -{LARGEST:e} to {LARGEST:e}"))),
    }
}

/// Checks the actions that have values.
fn choices(problem: &DeclaredProblem) -> Result<(), FieldError> {
    let mut choices = 1_usize;
    for (name, values) in problem.actions.iter().filter_map(|(name, action)| Some((name, action.values.as_ref()?))) {
        choices = choices.saturating_mul(values.len());
        let field = format!("problem.actions.{name}.values");
        if !(1..=MOST_CHOICES).contains(&choices) {
            let rule = format!("must have 1 to {MOST_CHOICES} numbers, multiplied over all actions that have them");
            return Err(FieldError::new(field, values.len(), rule));
        }
        for (index, value) in values.iter().enumerate() {
            is_number(format!("{field}[{index}]"), *value)?;
            if values[..index].contains(value) {
                return Err(FieldError::new(format!("{field}[{index}]"), *value, "must be there once"));
            }
        }
    }
    Ok(())
}

/// Checks the horizon and the radius, in the unit of the noise.
fn sizes(problem: &DeclaredProblem) -> Result<(), FieldError> {
    whole("problem.horizon", problem.horizon, &HORIZON)?;
    // The bounds of an investor's radius, whose support has a width of 1 here.
    let width = problem.noise.high - problem.noise.low;
    match problem.radius {
        Some(RadiusRule::RootN { kappa }) => within("problem.radius.kappa", kappa, KAPPA.0, KAPPA.1 * width)?,
        Some(RadiusRule::Fixed { radius }) => {
            within("problem.radius.radius", radius, FIXED_RADIUS.0, FIXED_RADIUS.1 * width)?;
        }
        _ => {}
    }
    Ok(())
}
