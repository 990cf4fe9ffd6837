//! The policy of a problem declared in formulas: the document, and the actions that it finds at any state.

mod advisor;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

pub use self::advisor::DeclaredAdvisor;
use super::document::check_surrogates;
use crate::control::cache::Cache;
use crate::control::declared_training::DeclaredTraining;
use crate::control::error::{FieldError, TrainError};
use crate::control::problem::declared::Baseline;
use crate::control::progress::Watch;
use crate::control::request::declared::DeclaredSpecification;
use crate::control::request::rules;
use crate::control::solved_step::{StepDiagnostics, StepSolution};

/// Name and version of the portable form.
pub const FORMAT: &str = "ballast-declared-1";

/// The completed declaration and the solutions of all steps but the first, ascending. The first is solved on request, as
/// every step is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredPolicy {
    format: String,
    specification: DeclaredSpecification,
    /// The amount that a gain of 1 is worth; 1 if a utility counts ratios.
    unit: f64,
    /// Worths from which surrogates count gains, for the step of each; none if a utility counts ratios.
    baselines: Vec<Baseline>,
    steps: Vec<StepSolution>,
}

/// The best actions of a period, their worth, and the law that is worst for them.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Decided {
    /// The period decided, from 1.
    pub period: usize,
    /// The best actions, by name.
    pub actions: BTreeMap<String, f64>,
    /// Actions along which the worth has several peaks, the others as advised. Many even ones were tried
    /// before a search around the best.
    pub several_peaks: Vec<String>,
    /// Worth of this period and those after it against the worst law, as of this period. With a utility its certainty equivalent.
    pub value: f64,
    /// Radius of the ball, in the unit of the noise.
    pub radius: f64,
    /// The worst law of the period: where the mass of the noises seen goes, ascending. Shares add up to 1.
    pub worst_law: Vec<NoiseMove>,
    /// Value less its lower bound by duality, both of this step.
    pub duality_gap: f64,
    /// Root mean square error of the value, as of this period, over the states of the step after. Null if the policy was
    /// not trained to an accuracy.
    pub value_error: Option<f64>,
    /// Share of the worst law's outcomes after which the next state is unlike those that the next step was trained at.
    /// What they are worth is then a guess.
    pub untrained_share: f64,
}

/// Mass of the law that is moved from one noise to another, or kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct NoiseMove {
    /// The noise seen.
    pub from: f64,
    /// The noise in its place.
    pub to: f64,
    /// Share of the whole mass.
    pub share: f64,
}

impl Decided {
    /// Trains a declared problem on the current rayon pool, and decides its first period.
    ///
    /// # Errors
    /// The errors of [`DeclaredPolicy::train`] and [`DeclaredAdvisor::decide`].
    pub fn first(declared: &DeclaredSpecification, watch: &Watch) -> Result<Self, TrainError> {
        Ok(DeclaredPolicy::train(declared, watch)?.prepared(Cache::default())?.decide(1, None, &[])?)
    }
}

impl DeclaredPolicy {
    /// Builds the policy of a training from the solutions of its steps, ascending from the second.
    pub fn new(training: &DeclaredTraining, steps: Vec<StepSolution>) -> Self {
        let (unit, baselines) = training.problem().gains();
        let (format, specification) = (FORMAT.to_owned(), training.declared().clone());
        DeclaredPolicy { format, specification, unit, baselines, steps }
    }

    /// Trains a declared problem on the current rayon pool.
    ///
    /// # Errors
    /// A field that breaks a rule, and those of [`DeclaredTraining::solve_step`].
    pub fn train(declared: &DeclaredSpecification, watch: &Watch) -> Result<Self, TrainError> {
        let training = DeclaredTraining::with(declared, Cache::default())?;
        let steps = training.run(watch)?;
        Ok(DeclaredPolicy::new(&training, steps))
    }

    /// Returns the completed declaration.
    pub fn specification(&self) -> &DeclaredSpecification {
        &self.specification
    }

    /// Returns the diagnostics of every trained step, ascending.
    pub fn diagnostics(&self) -> impl Iterator<Item = &StepDiagnostics> {
        self.steps.iter().map(|step| &step.diagnostics)
    }

    /// Returns the solutions of the trained steps, ascending from the second.
    pub fn steps(&self) -> &[StepSolution] {
        &self.steps
    }

    /// Reads the declaration as any other, checks that the steps fit it, and returns what was read.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn checked(&self, kept: Cache) -> Result<DeclaredTraining, FieldError> {
        if self.format != FORMAT {
            return Err(FieldError::new("format", &self.format, format!("must be {FORMAT}")));
        }
        let training = DeclaredTraining::with(&self.specification, kept)?;
        if *training.declared() != self.specification {
            return Err(FieldError::new("specification", "an incomplete object", "must have every field filled in"));
        }
        let (horizon, features) = (training.horizon(), training.feature_count()?);
        if self.steps.len() + 1 != horizon {
            let rule = format!("must hold all steps but the first: {}", horizon - 1);
            return Err(FieldError::new("steps", self.steps.len(), rule));
        }
        let (unit, baselines) = training.problem().gains();
        if unit != self.unit {
            return Err(FieldError::new("unit", self.unit, format!("must be {unit}, by the declaration")));
        }
        if baselines != self.baselines {
            return Err(FieldError::new("baselines", "other baselines", "must be those of the declaration"));
        }
        for (index, step) in self.steps.iter().enumerate() {
            if step.step != index + 1 {
                let rule = format!("must be {}", index + 1);
                return Err(FieldError::new(format!("steps[{index}].step"), step.step, rule));
            }
            let field = format!("steps[{index}].solution");
            let Some(stored) = step.solution.surrogates() else {
                return Err(FieldError::new(format!("{field}.kind"), "single", "must be surrogates"));
            };
            check_surrogates(&field, stored, features)?;
            let actions = self.specification.problem.actions.len();
            rules::whole(&format!("{field}.value.weights"), stored.value.weights.len(), &(1..=1))?;
            rules::whole(&format!("{field}.policy.weights"), stored.policy.weights.len(), &(actions..=actions))?;
        }
        Ok(training)
    }
}
