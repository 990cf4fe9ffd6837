//! The walk-forward of a declared problem: its record of noises, and how the walk-forward goes through it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::backtest::{MOST_STEPS, MOST_TRAININGS, PERIODS};
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, whole, within};
use crate::control::request::by_name::distinct_twice;
use crate::control::request::declared::{DeclaredDesign, DeclaredProblem, DeclaredSpecification};
use crate::control::request::declared_comparison::{MOST_RULES, check_names, trained};
use crate::control::request::evaluation::{LEVEL, defaults};
use crate::control::request::framework::Framework;
use crate::control::request::rules::{HISTORY_LENGTH, HORIZON};
use crate::control::request::specification::{SurrogateSpecification, default_seed};

/// Frameworks whose policies walk: the law of the whole record would be known before its time.
const WALKED: [Framework; 3] = [Framework::Adaptive, Framework::Static, Framework::PlugIn];
/// Largest number of decisions of all strategies: a report of some hundred megabytes.
const MOST_DECISIONS: usize = 200_000;

/// A walk-forward of a declared problem through a record of noises. At regular intervals a policy is trained on the noises
/// before, from the states that it led to, and followed until the next training, as a session that renews itself does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredBacktest {
    /// The declaration. Its `history` is the whole record, oldest first; after the first window it is lived period by period.
    pub problem: DeclaredProblem,
    /// States that the surrogates are trained on.
    #[serde(default)]
    pub design: DeclaredDesign,
    /// Settings of the surrogates.
    #[serde(default)]
    pub surrogate: SurrogateSpecification,
    /// Seed of all random draws. The same request and seed give the same report, bit for bit. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Number of noises that each policy is trained on, at least 2. Default: half of the record.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<usize>,
    /// Number of periods from one training to the next, at most the horizon. Default: the horizon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<usize>,
    /// Frameworks whose policies are followed: `adaptive`, `static` and `plug_in`. The first is the one that others are
    /// compared with. Default: the framework of `problem`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frameworks: Vec<Framework>,
    /// Rules by names of your own, at most 20: for each action a formula of the states, the parameters, `t`, which begins anew
    /// with each training, and `T`. An action is moved into its bounds, or to the nearest of its values.
    #[serde(default, deserialize_with = "distinct_twice")]
    #[schema(example = json!({ "base stock": { "order": "max(25 - stock, 0)" } }))]
    pub rules: BTreeMap<String, BTreeMap<String, String>>,
    /// Confidence of the intervals, 0.5 to 0.999. Default 0.95.
    #[serde(default = "defaults::level")]
    pub level: f64,
}

impl Bounded for DeclaredBacktest {
    const BOUNDS: &'static [FieldBounds] = &[
        ("window", ValueBounds::count(&HISTORY_LENGTH)),
        ("every", ValueBounds::count(&HORIZON)),
        ("level", ValueBounds::number(LEVEL)),
    ];
}

impl DeclaredBacktest {
    /// Fills in the defaults, and checks every rule but those of the trainings.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn completed(mut self) -> Result<Self, FieldError> {
        let (record, horizon) = (self.problem.history.len(), self.problem.horizon);
        whole("problem.horizon", horizon, &HORIZON)?;
        let (window, every) = (self.window.unwrap_or(record / 2), self.every.unwrap_or(horizon));
        if record < 3 {
            let rule = "must have 3 at least: two to learn from, and one to live";
            return Err(FieldError::new("problem.history", format!("{record} noises"), rule));
        }
        if record > *PERIODS.end() {
            let rule = format!("must have {} at most", PERIODS.end());
            return Err(FieldError::new("problem.history", format!("{record} noises"), rule));
        }
        if !(2..record).contains(&window) {
            let rule = format!("must be from 2 to {}: the record has {record} noises, and one must follow", record - 1);
            return Err(FieldError::new("window", window, rule));
        }
        if !(1..=horizon).contains(&every) {
            let rule =
                format!("must be from 1 to the horizon, {horizon}: a policy is followed until the next is trained");
            return Err(FieldError::new("every", every, rule));
        }
        self.frameworks = trained(&self.problem, self.frameworks, &WALKED)?;
        whole("rules", self.rules.len(), &(0..=MOST_RULES))?;
        check_names("rules", self.rules.keys(), &self.frameworks)?;
        within("level", self.level, LEVEL.0, LEVEL.1)?;
        (self.window, self.every) = (Some(window), Some(every));
        let lived = record - window;
        let trainings = self.frameworks.len() * lived.div_ceil(every);
        let steps = trainings.saturating_mul(horizon - 1);
        if trainings > MOST_TRAININGS || steps > MOST_STEPS {
            let rule = format!(
                "must be larger: {trainings} policies of {steps} steps in all would be trained, and at most {MOST_TRAININGS} of {MOST_STEPS} steps are allowed"
            );
            return Err(FieldError::new("every", every, rule));
        }
        let decisions = lived * (self.frameworks.len() + self.rules.len());
        if decisions > MOST_DECISIONS {
            let rule = format!(
                "must be shorter: all strategies together would decide {decisions} times, and at most {MOST_DECISIONS} are allowed"
            );
            return Err(FieldError::new("problem.history", format!("{record} noises"), rule));
        }
        Ok(self)
    }

    /// Returns the declaration with the settings of its trainings.
    pub fn specification(&self) -> DeclaredSpecification {
        let DeclaredBacktest { problem, design, surrogate, seed, .. } = self.clone();
        DeclaredSpecification { problem, design, surrogate, seed }
    }
}
