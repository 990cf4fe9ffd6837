//! A comparison of policies of a declared problem with rules that are formulas.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, whole, within};
use crate::control::request::by_name::{distinct, distinct_twice};
use crate::control::request::evaluation::{EvaluationRequest, LEVEL, PATHS, defaults};
use crate::control::request::specification::default_seed;

/// Allowed number of policies, and the most rules.
const POLICIES: std::ops::RangeInclusive<usize> = 1..=8;
const MOST_RULES: usize = 20;
/// Largest number of decisions of one policy; each may take a robust step.
const MOST_DECISIONS: usize = 200_000;

/// A comparison of trained policies of one declared problem, and of rules, on common noises drawn from the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredComparison {
    /// Policies by names of your own, 1 to 8. Their declarations may differ in `framework`, `radius` and `learning`. The
    /// first by name is the one that others are compared with.
    #[serde(deserialize_with = "distinct")]
    pub policies: BTreeMap<String, String>,
    /// Rules by names of your own, at most 20: for each action a formula of the states, the parameters, `t` and `T`. An action
    /// is moved into its bounds, or to the nearest of its values.
    #[serde(default, deserialize_with = "distinct_twice")]
    #[schema(example = json!({ "base stock": { "order": "max(25 - stock, 0)" } }))]
    pub rules: BTreeMap<String, BTreeMap<String, String>>,
    /// Number of simulated paths, 100 to 100,000. Default 1000.
    #[serde(default = "defaults::paths")]
    pub paths: usize,
    /// Seed of all random draws. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Confidence of the intervals, 0.5 to 0.999. Default 0.95.
    #[serde(default = "defaults::level")]
    pub level: f64,
}

/// A comparison of an investor's strategies, or of policies and rules of a declared problem, which has no `problem` of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum EvaluationQuestion {
    /// Strategies of an investor.
    Investor(Box<EvaluationRequest>),
    /// Policies and rules of a declared problem.
    Declared(Box<DeclaredComparison>),
}

impl Bounded for DeclaredComparison {
    const BOUNDS: &'static [FieldBounds] =
        &[("paths", ValueBounds::count(&PATHS)), ("level", ValueBounds::number(LEVEL))];
}

impl DeclaredComparison {
    /// Checks what can be checked before the policies are read.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn check(&self) -> Result<(), FieldError> {
        whole("policies", self.policies.len(), &POLICIES)?;
        whole("rules", self.rules.len(), &(0..=MOST_RULES))?;
        whole("paths", self.paths, &PATHS)?;
        within("level", self.level, LEVEL.0, LEVEL.1)?;
        if let Some(name) = self.rules.keys().find(|name| self.policies.contains_key(*name)) {
            return Err(FieldError::new(format!("rules.{name}"), name, "must not have the name of a policy"));
        }
        Ok(())
    }

    /// Checks the number of decisions on paths of so many periods.
    ///
    /// # Errors
    /// There are too many.
    pub fn check_decisions(&self, horizon: usize) -> Result<(), FieldError> {
        let most = MOST_DECISIONS / horizon;
        if self.paths <= most {
            return Ok(());
        }
        let rule = format!("must be at most {most}: {MOST_DECISIONS} decisions of {horizon} periods");
        Err(FieldError::new("paths", self.paths, rule))
    }
}
