//! A comparison of policies of a declared problem with rules that are formulas.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, whole, within};
use crate::control::request::by_name::{distinct, distinct_twice};
use crate::control::request::declared::{DeclaredDesign, DeclaredProblem, DeclaredSpecification};
use crate::control::request::evaluation::{EvaluationRequest, LEVEL, PATHS, defaults};
use crate::control::request::framework::Framework;
use crate::control::request::specification::{SurrogateSpecification, default_seed};

/// Frameworks that are compared.
const COMPARED: [Framework; 4] = [Framework::Adaptive, Framework::Static, Framework::PlugIn, Framework::KnownLaw];
/// Allowed number of policies, and the most rules.
const POLICIES: std::ops::RangeInclusive<usize> = 1..=8;
pub(super) const MOST_RULES: usize = 20;
/// Largest number of decisions of one policy; each may take a robust step.
const MOST_DECISIONS: usize = 200_000;

/// A comparison of policies of one declared problem, and of rules, on common noises drawn from the record. Policies are
/// trained here, or were trained before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredComparison {
    /// The declaration, if policies are to be trained for it. Without it there must be `policies`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<DeclaredProblem>,
    /// Frameworks for which a policy of `problem` is trained: `adaptive`, `static`, `plug_in` and `known_law`, which takes the
    /// law of the record as true. Default: the framework of `problem`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frameworks: Vec<Framework>,
    /// States that the surrogates of these policies are trained on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design: Option<DeclaredDesign>,
    /// Settings of these surrogates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surrogate: Option<SurrogateSpecification>,
    /// Trained policies by names of your own; with the frameworks 1 to 8. Their declarations may differ in `framework`, `radius`
    /// and `learning`. Others are compared with the first by name, or without policies with the first framework.
    #[serde(default, deserialize_with = "distinct")]
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

/// A comparison of an investor's strategies, or of policies and rules of a declared problem.
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
    /// Fills in the frameworks, and checks what can be checked before the policies are read.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn completed(mut self) -> Result<Self, FieldError> {
        if self.problem.is_none() {
            let given = [
                ("frameworks", !self.frameworks.is_empty()),
                ("design", self.design.is_some()),
                ("surrogate", self.surrogate.is_some()),
            ];
            if let Some((field, _)) = given.into_iter().find(|(_, is_given)| *is_given) {
                return Err(FieldError::new(field, "given", "must be absent without `problem`"));
            }
        }
        if let Some(problem) = &self.problem {
            self.frameworks = trained(problem, self.frameworks, &COMPARED)?;
        }
        whole("policies", self.frameworks.len() + self.policies.len(), &POLICIES)?;
        whole("rules", self.rules.len(), &(0..=MOST_RULES))?;
        whole("paths", self.paths, &PATHS)?;
        within("level", self.level, LEVEL.0, LEVEL.1)?;
        if let Some(name) = self.rules.keys().find(|name| self.policies.contains_key(*name)) {
            return Err(FieldError::new(format!("rules.{name}"), name, "must not have the name of a policy"));
        }
        check_names("rules", self.rules.keys(), &self.frameworks)?;
        check_names("policies", self.policies.keys(), &self.frameworks)?;
        Ok(self)
    }

    /// Returns the declaration of the policies that are trained, if there are any.
    pub fn specification(&self) -> Option<DeclaredSpecification> {
        let problem = self.problem.clone()?;
        let (design, surrogate) = (self.design.unwrap_or_default(), self.surrogate.clone().unwrap_or_default());
        Some(DeclaredSpecification { problem, design, surrogate, seed: self.seed })
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

/// Returns the frameworks for which policies are trained: by default that of the problem.
///
/// # Errors
/// A framework that is not among the `allowed`, or stands twice.
pub(super) fn trained(
    problem: &DeclaredProblem,
    mut frameworks: Vec<Framework>,
    allowed: &[Framework],
) -> Result<Vec<Framework>, FieldError> {
    if frameworks.is_empty() {
        frameworks.push(problem.framework);
    }
    for (index, framework) in frameworks.iter().enumerate() {
        let rule = match allowed.contains(framework) {
            false => {
                let names: Vec<&str> = allowed.iter().map(|allowed| allowed.name()).collect();
                format!("must be one of {}", names.join(", "))
            }
            true if frameworks[..index].contains(framework) => "must not stand twice".to_owned(),
            true => continue,
        };
        return Err(FieldError::new(format!("frameworks[{index}]"), framework.name(), rule));
    }
    Ok(frameworks)
}

/// Checks that no strategy has the name of a framework that is compared.
pub(super) fn check_names<'a>(
    field: &str,
    mut names: impl Iterator<Item = &'a String>,
    frameworks: &[Framework],
) -> Result<(), FieldError> {
    match names.find(|name| frameworks.iter().any(|framework| framework.name() == **name)) {
        Some(name) => {
            Err(FieldError::new(format!("{field}.{name}"), name, "must not have the name of one of the frameworks"))
        }
        None => Ok(()),
    }
}
