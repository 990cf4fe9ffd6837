//! A problem declared in formulas, as a controlled problem.
//!
//! The solver's noise runs from -1/2 to 1/2 over the support, so that its tolerances fit any unit. What was earned so far is carried beside the states. The worth of a path is
//!
//!   reward_0 + discount reward_1 + ... + discount^T end,
//!
//! and V at a state is the worth still to come. The state is described without what is carried, on which nothing
//! depends.

mod baseline;
pub(in crate::control) mod formula;
mod jumps;
mod lived;
mod reading;
mod rules;
mod sampling;

use std::cell::RefCell;
use std::sync::OnceLock;

pub use self::baseline::Baseline;
use self::formula::Formula;
pub use self::rules::FormulaRule;
use super::actions::{ActionInterval, ActionSet};
use super::controlled::Controlled;
use super::utility::RelativeUtility;
use crate::control::error::FieldError;
use crate::control::request::bounds::within;
use crate::control::request::specification::UtilitySpecification;

/// Errors of gains are counted in parts of this many.
const TEN_THOUSAND: f64 = 1e4;
/// Rounding of a state at the edge of its range, as a share of the range.
const EDGE: f64 = 1e-9;
/// Least amount of which a power or a logarithm is computed.
const LEAST_AMOUNT: f64 = 1e-300;

/// A declared problem whose formulas are parsed and whose rules hold.
#[derive(Debug, Clone)]
pub struct Declared {
    /// States, actions, the noise, `t`, `T` and the parameters, in the order of the values of a formula.
    names: Vec<String>,
    ranges: Vec<[f64; 2]>,
    start: Vec<f64>,
    parameters: Vec<f64>,
    actions: Vec<Action>,
    next: Vec<Formula>,
    reward: Option<Formula>,
    /// The worth at the end, or the amount whose utility counts.
    end: Formula,
    utility: Option<UtilitySpecification>,
    discount: f64,
    horizon: usize,
    noise: [f64; 2],
    /// Size of the amounts, which makes payoffs numbers around 1.
    unit: f64,
    /// Earnings of random paths from each step on, or with an exponential utility the amount at their end.
    baselines: Vec<Baseline>,
    /// The first state that left its range.
    left: OnceLock<FieldError>,
}

/// The choice of one action.
#[derive(Debug, Clone)]
enum Action {
    /// The formulas of its bounds.
    Bounds([Formula; 2]),
    /// All of its values.
    Values(Vec<f64>),
}

/// The states, and what was earned on the way to them.
#[derive(Debug, Clone, PartialEq)]
pub struct EarnedState {
    /// In the order of their names.
    pub values: Vec<f64>,
    /// Rewards so far, discounted.
    pub earned: f64,
}

thread_local! {
    /// Memory for the values of the names, and for a formula's own.
    static MEMORY: RefCell<(Vec<f64>, Vec<f64>)> = const { RefCell::new((Vec::new(), Vec::new())) };
}

impl Declared {
    /// Returns the state at the start.
    pub fn start(&self) -> EarnedState {
        EarnedState { values: self.start.clone(), earned: 0.0 }
    }

    /// Returns the problem without the fault that states have reached.
    pub fn afresh(&self) -> Declared {
        Declared { left: OnceLock::new(), ..self.clone() }
    }

    /// Names the numbers of a state in words.
    pub fn named(&self, step: usize, state: &EarnedState) -> String {
        self.point(step, &state.values, None)
    }

    /// Returns the amount that a gain of 1 is worth, and what gains count from at each step after the first. If a utility
    /// counts ratios they are 1 and none: a gain is then the logarithm of a ratio.
    pub fn gains(&self) -> (f64, Vec<Baseline>) {
        match self.of_ratio(1.0) {
            Some(_) => (1.0, Vec::new()),
            None => (self.unit, self.baselines[1..].to_vec()),
        }
    }

    /// Returns the amount of an error of gains in ten-thousandths around a worth. If a utility counts ratios it is a share of
    /// the worth; otherwise it does not depend on it, and is an amount as of the start.
    pub fn error_amount(&self, of_gains: f64, worth: f64) -> f64 {
        of_gains / TEN_THOUSAND * self.of_ratio(1.0).map_or(self.unit, |_| worth.abs())
    }

    /// Returns what an amount of a step is worth at the start; never 0, by which one would divide.
    pub fn discounted(&self, step: usize) -> f64 {
        self.discount.powi(step as i32).max(f64::MIN_POSITIVE)
    }

    /// Returns the names of the states.
    pub fn states_named(&self) -> &[String] {
        &self.names[..self.ranges.len()]
    }

    /// Returns the names of the actions.
    pub fn actions_named(&self) -> &[String] {
        &self.names[self.ranges.len()..][..self.actions.len()]
    }

    /// Returns the name and the support of the noise.
    pub fn noise_named(&self) -> (&str, [f64; 2]) {
        (&self.names[self.ranges.len() + self.actions.len()], self.noise)
    }

    /// Returns the noise in its own unit from that of the solver.
    pub fn noise(&self, scaled: f64) -> f64 {
        let [low, high] = self.noise;
        low + (scaled + 0.5) * (high - low)
    }

    /// Returns the width of the support of the noise, in its own unit.
    pub fn noise_width(&self) -> f64 {
        self.noise[1] - self.noise[0]
    }

    /// Returns the noise of the solver from one in its own unit.
    ///
    /// # Errors
    /// It lies beyond its support.
    pub fn checked_noise(&self, field: &str, noise: f64) -> Result<f64, FieldError> {
        within(field, noise, self.noise[0], self.noise[1]).map(|()| self.scaled(noise))
    }

    /// Returns the noise of the solver from one in its own unit.
    pub fn scaled(&self, noise: f64) -> f64 {
        let [low, high] = self.noise;
        (noise - low) / (high - low) - 0.5
    }

    /// Returns why the problem cannot be solved as declared: a state left its range.
    pub fn fault(&self) -> Option<&FieldError> {
        self.left.get()
    }

    /// Evaluates formulas at a state and what moves it: actions and a noise, or nothing if they are not known.
    fn at<T>(
        &self,
        step: usize,
        state: &[f64],
        moved: Option<(&[f64], f64)>,
        evaluate: impl FnOnce(&dyn Fn(&Formula) -> f64) -> T,
    ) -> T {
        MEMORY.with_borrow_mut(|(values, stack)| {
            values.clear();
            values.extend(state);
            match moved {
                Some((actions, noise)) => values.extend(actions.iter().chain([&noise])),
                None => values.resize(state.len() + self.actions.len() + 1, 0.0),
            }
            values.extend([step as f64, self.horizon as f64]);
            values.extend(&self.parameters);
            let stack = RefCell::new(stack);
            evaluate(&|formula| formula.value(values, &mut stack.borrow_mut()))
        })
    }

    /// Evaluates `next` and `reward`, with the actions and the noise in their own units.
    fn period(&self, step: usize, state: &EarnedState, moved: (&[f64], f64)) -> (Vec<f64>, f64) {
        self.at(step, &state.values, Some(moved), |value| {
            let next = self.next.iter().map(value).collect();
            (next, self.reward.as_ref().map_or(0.0, value))
        })
    }

    /// Returns the state after a period whose formulas have these values. Keeps states within their ranges, and the first
    /// that left its own.
    fn after(
        &self,
        (step, state): (usize, &EarnedState),
        moved: (&[f64], f64),
        (mut values, reward): (Vec<f64>, f64),
    ) -> EarnedState {
        for (place, value) in values.iter_mut().enumerate() {
            let [low, high] = self.ranges[place];
            let slack = EDGE * (high - low);
            if !(low - slack..=high + slack).contains(value) {
                self.left.get_or_init(|| self.leaving(place, *value, (step, state), moved));
            }
            *value = if value.is_nan() { low } else { value.clamp(low, high) };
        }
        EarnedState { values, earned: state.earned + self.discount.powi(step as i32) * reward }
    }

    /// Returns why a state left its range.
    fn leaving(
        &self,
        place: usize,
        value: f64,
        (step, state): (usize, &EarnedState),
        moved: (&[f64], f64),
    ) -> FieldError {
        let [low, high] = self.ranges[place];
        let at = self.point(step, &state.values, Some(moved));
        let rule = format!("must stay from {low} to {high}; it leaves at {at}");
        FieldError::new(format!("problem.next.{}", self.names[place]), value, rule)
    }

    /// Names a point in words.
    fn point(&self, step: usize, state: &[f64], moved: Option<(&[f64], f64)>) -> String {
        let moved = moved.into_iter().flat_map(|(actions, noise)| actions.iter().copied().chain([noise]));
        let values = state.iter().copied().chain(moved).map(|value| (1e6 * value).round() / 1e6);
        let named: Vec<String> =
            self.names.iter().zip(values).map(|(name, value)| format!("{name} = {value}")).collect();
        format!("{}, t = {step}", named.join(", "))
    }

    /// Returns the worth of ending in a state.
    fn ended(&self, step: usize, state: &EarnedState) -> f64 {
        let end = self.at(step, &state.values, None, |value| value(&self.end));
        match self.utility {
            None => state.earned + self.discount.powi(self.horizon as i32) * end,
            Some(_) => end,
        }
    }

    /// Returns the utility relative to an amount if it counts ratios.
    fn of_ratio(&self, from: f64) -> Option<RelativeUtility> {
        let utility = self.utility?;
        let is_of_ratio = !matches!(utility, UtilitySpecification::Exponential { .. });
        is_of_ratio.then(|| RelativeUtility::new(utility, from))
    }

    /// Returns the risk aversion of an exponential utility, in units of the amounts.
    fn risk_aversion(&self) -> Option<f64> {
        match self.utility {
            Some(UtilitySpecification::Exponential { risk_aversion, .. }) => Some(risk_aversion * self.unit),
            _ => None,
        }
    }
}

impl Controlled for Declared {
    type State = EarnedState;

    fn actions(&self, step: usize, state: &EarnedState) -> Vec<ActionSet> {
        self.at(step, &state.values, None, |value| {
            let set = |action: &Action| match action {
                Action::Bounds([low, high]) => {
                    ActionSet::Interval(ActionInterval { lowest: value(low), highest: value(high) })
                }
                Action::Values(values) => ActionSet::Values(values.clone()),
            };
            self.actions.iter().map(set).collect()
        })
    }

    fn next(&self, step: usize, state: &EarnedState, actions: &[f64], scaled: f64) -> EarnedState {
        let moved = (actions, self.noise(scaled));
        self.after((step, state), moved, self.period(step, state, moved))
    }

    fn describe(&self, _: usize, state: &EarnedState) -> Vec<f64> {
        state.values.clone()
    }

    /// Returns the worth itself at the horizon. Before it, what was earned and about what random paths earn from there. If a
    /// utility counts ratios, the amount as if this were the end, which is positive.
    fn baseline(&self, step: usize, state: &EarnedState) -> f64 {
        match self.baselines.get(step) {
            Some(to_come) if self.of_ratio(1.0).is_none() => state.earned + to_come.at(&state.values),
            _ => self.ended(step, state),
        }
    }

    fn has_floor(&self) -> bool {
        false
    }

    fn is_concave(&self) -> bool {
        false
    }

    fn utility(&self, worth: f64, from: f64) -> f64 {
        if let Some(utility) = self.of_ratio(from) {
            return utility.value((worth.max(LEAST_AMOUNT) / from).ln());
        }
        let gain = (worth - from) / self.unit;
        self.risk_aversion().map_or(gain, |k| -(-k * gain).exp_m1() / k)
    }

    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64 {
        if let Some(relative) = self.of_ratio(from) {
            return from * relative.inverse(utility).exp();
        }
        let gain = self.risk_aversion().map_or(utility, |k| -(-k * utility).ln_1p() / k);
        from + self.unit * gain
    }

    fn gain(&self, worth: f64, baseline: f64) -> f64 {
        if self.of_ratio(baseline).is_some() { (worth / baseline).ln() } else { (worth - baseline) / self.unit }
    }

    fn worth(&self, gain: f64, baseline: f64) -> f64 {
        if self.of_ratio(baseline).is_some() { baseline * gain.exp() } else { baseline + self.unit * gain }
    }
}
