//! A problem declared in formulas: its states, its action, the noise whose law is learned, and what is earned.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::by_name::distinct;
use crate::control::request::framework::Framework;
use crate::control::request::learning::Learning;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::rules::{COUNT, HISTORY_LENGTH, HORIZON};
use crate::control::request::specification::{SurrogateSpecification, default_seed};

/// A declared problem, with the settings of its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredSpecification {
    /// The problem.
    pub problem: DeclaredProblem,
    /// States that the surrogates are trained on.
    #[serde(default)]
    pub design: DeclaredDesign,
    /// Settings of the surrogates.
    #[serde(default)]
    pub surrogate: SurrogateSpecification,
    /// Seed of all random draws.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// The states that the surrogates of a declared problem are trained on.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredDesign {
    /// Target accuracy of the worth, in its own unit as of the start: the root mean square error over the states of a step,
    /// including the errors of later steps. Design points are added until fresh states show that it is reached, or until
    /// there are `count`. Default: none, and `count` decides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// Number of design points per step, 10 to 10,000; with an `accuracy`, the largest number. Default 1000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
}

/// `V_t(x, F) = max_a min_{F' in C_t(F)} E_{F'}[ reward + discount V_{t+1}(next, F + Z) ]`, and `V_T = end`. With a
/// utility the value is the certainty equivalent of the amount at the end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredProblem {
    /// States by name, 1 to 6.
    #[serde(deserialize_with = "distinct")]
    pub states: BTreeMap<String, DeclaredState>,
    /// Actions by name, 1 to 3.
    #[serde(deserialize_with = "distinct")]
    pub actions: BTreeMap<String, DeclaredAction>,
    /// The noise.
    pub noise: Noise,
    /// Numbers by name, for the formulas.
    #[serde(default, deserialize_with = "distinct")]
    pub parameters: BTreeMap<String, f64>,
    /// Formula of each state after a period.
    #[serde(deserialize_with = "distinct")]
    pub next: BTreeMap<String, String>,
    /// Formula of what a period earns. Default: nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reward: Option<String>,
    /// Formula of the worth of the state at the end; absent if there is a utility, which has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<String>,
    /// Factor per period on what comes after it, above 0 and at most 1. Default 1.
    #[serde(default = "no_discount")]
    pub discount: f64,
    /// Utility of an amount at the end. Default: the sum of the rewards and the end itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub utility: Option<DeclaredUtility>,
    /// Number of decisions, T, 1 to 520.
    pub horizon: usize,
    /// Noises observed before the start, oldest first.
    pub history: Vec<f64>,
    /// The framework: `adaptive`, `static` or `plug_in`. Default: `adaptive`.
    #[serde(default)]
    pub framework: Framework,
    /// Weights of older noises in the learned law. Default: `equal`.
    #[serde(default)]
    pub learning: Learning,
    /// Rule for the radius of the ball, in the unit of the noise. Default: `bridge`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<RadiusRule>,
}

/// A state: where it starts, and the range that it never leaves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredState {
    /// Value at the start.
    pub start: f64,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
}

/// An action: any number between two bounds, or one of some values.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredAction {
    /// Formula of the lowest action, of the states, the parameters, `t` and `T`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<String>,
    /// Formula of the highest action, of the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<String>,
    /// The actions that there are, instead of bounds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
}

/// The noise, observed each period, and its support.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Its name in the formulas.
    pub name: String,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
}

/// A utility of the amount that a formula of the states gives at the end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum DeclaredUtility {
    /// `(1 - exp(-risk_aversion x)) / risk_aversion`.
    Exponential {
        /// Absolute risk aversion, per unit of the amount.
        risk_aversion: f64,
        /// Formula of the amount.
        of: String,
    },
    /// `(x^(1 - risk_aversion) - 1) / (1 - risk_aversion)` of a positive amount.
    Power {
        /// Relative risk aversion, above 1 and at most 100.
        risk_aversion: f64,
        /// Formula of the amount.
        of: String,
    },
    /// `ln x` of a positive amount.
    Log {
        /// Formula of the amount.
        of: String,
    },
}

impl DeclaredSpecification {
    /// Returns the same problem under another framework. `known_law` takes the law of the history as true.
    #[must_use]
    pub fn under(&self, framework: Framework) -> Self {
        let mut own = self.clone();
        own.problem.framework = framework;
        if framework == Framework::KnownLaw {
            own.problem.framework = Framework::Static;
            own.problem.radius = Some(RadiusRule::Fixed { radius: 0.0 });
        }
        own
    }

    /// Returns the problem of the next policy of one who lives this problem: of the last `window` noises of those known,
    /// from the present states.
    #[must_use]
    pub fn next(&self, known: impl Iterator<Item = f64>, window: Option<usize>, states: BTreeMap<String, f64>) -> Self {
        let mut next = self.clone();
        next.problem.history = known.collect();
        let most = window.unwrap_or(usize::MAX).min(*HISTORY_LENGTH.end());
        next.problem.history.drain(..next.problem.history.len().saturating_sub(most));
        for (name, value) in states {
            next.problem.states.entry(name).and_modify(|state| state.start = value);
        }
        next
    }
}

impl DeclaredProblem {
    /// Returns the texts of its formulas.
    pub fn formulas(&self) -> impl Iterator<Item = &str> {
        let bounds = self.actions.values().flat_map(|action| [&action.low, &action.high]).flatten();
        let utility = self.utility.as_ref().map(DeclaredUtility::of);
        let all = self.next.values().chain(bounds).chain(&self.reward).chain(&self.end);
        all.map(String::as_str).chain(utility)
    }

    /// Returns true if the other has the same states, actions, dynamics, worths and record. Its framework, radius and
    /// learning may differ.
    pub fn is_alike(&self, other: &DeclaredProblem) -> bool {
        let DeclaredProblem { framework, radius, learning, .. } = self.clone();
        *self == DeclaredProblem { framework, radius, learning, ..other.clone() }
    }
}

impl Bounded for DeclaredProblem {
    const BOUNDS: &'static [FieldBounds] = &[
        ("discount", ValueBounds::Above(0.0, 1.0)),
        ("horizon", ValueBounds::count(&HORIZON)),
        ("history", ValueBounds::list(&HISTORY_LENGTH, &ValueBounds::Any)),
    ];
}

impl Bounded for DeclaredDesign {
    const BOUNDS: &'static [FieldBounds] = &[("count", ValueBounds::count(&COUNT))];
}

impl DeclaredUtility {
    /// Returns the formula of the amount.
    pub fn of(&self) -> &str {
        match self {
            DeclaredUtility::Exponential { of, .. }
            | DeclaredUtility::Power { of, .. }
            | DeclaredUtility::Log { of } => of,
        }
    }
}

fn no_discount() -> f64 {
    1.0
}
