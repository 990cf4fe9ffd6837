//! Training of a problem declared in formulas, step by step.

use super::cache::Cache;
use super::controlled_training::ControlledTraining;
use super::error::{FieldError, TrainError};
use super::problem::declared::{Declared, EarnedState};
use super::progress::Watch;
use super::request::completion::DEFAULT_COUNT;
use super::request::declared::DeclaredSpecification;
use super::request::specification::Specification;
use super::request::warnings::Warning;
use super::solved_step::StepSolution;

/// A declared problem that is read and checked, with the settings of its training.
pub struct DeclaredTraining {
    declared: DeclaredSpecification,
    problem: Declared,
    start: EarnedState,
    specification: Specification,
    kept: Cache,
}

impl DeclaredTraining {
    /// Reads a declared problem, with `kept` as the cache of recomputable results. Cost: its formulas at 10,000 points.
    ///
    /// # Errors
    /// A field that breaks a rule, a formula among them.
    pub fn with(declared: &DeclaredSpecification, kept: Cache) -> Result<Self, FieldError> {
        let mut declared = declared.clone();
        let problem = Declared::new(&declared.problem)?;
        let specification = problem.specification(&declared)?;
        declared.design.count.get_or_insert(DEFAULT_COUNT);
        declared.problem.radius.get_or_insert(specification.problem.radius_rule());
        let start = problem.start();
        let training = DeclaredTraining { declared, problem, start, specification, kept };
        training.controlled()?;
        Ok(training)
    }

    fn controlled(&self) -> Result<ControlledTraining<'_, Declared>, FieldError> {
        let DeclaredTraining { problem, start, specification, kept, .. } = self;
        let training = ControlledTraining::with(problem, start, specification, kept.clone())?;
        Ok(training.naming(problem.states_named()))
    }

    /// Returns the number of features of a state and its law.
    ///
    /// # Errors
    /// None: they were read when it was built.
    pub fn feature_count(&self) -> Result<usize, FieldError> {
        Ok(self.controlled()?.feature_count())
    }

    /// Returns the same with `kept` as the cache.
    #[must_use]
    pub fn keeping(self, kept: Cache) -> Self {
        DeclaredTraining { kept, ..self }
    }

    /// Returns the problem.
    pub fn problem(&self) -> &Declared {
        &self.problem
    }

    /// Returns the declaration with every default filled in.
    pub fn declared(&self) -> &DeclaredSpecification {
        &self.declared
    }

    /// Returns what the solver of controlled problems knows of it.
    pub fn specification(&self) -> &Specification {
        &self.specification
    }

    /// Returns the formulas that jump, which may be mistakes.
    pub fn warnings(&self) -> Vec<Warning> {
        self.problem.jumps()
    }

    /// Returns the number of periods. The steps after the first are trained.
    pub fn horizon(&self) -> usize {
        self.declared.problem.horizon
    }

    /// Trains a step, at least 1, given the step after it, as [`ControlledTraining::solve_step`] does.
    ///
    /// # Errors
    /// A state that leaves its range, and those of [`ControlledTraining::solve_step`].
    pub fn solve_step(
        &self,
        step: usize,
        after: Option<&StepSolution>,
        watch: &Watch,
    ) -> Result<StepSolution, TrainError> {
        let solved = self.controlled()?.solve_step(step, after, watch);
        // What left its range may have spoilt what was fitted.
        self.problem.fault().map_or(solved, |fault| Err(fault.clone().into()))
    }

    /// Trains every step but the first on the current rayon pool.
    ///
    /// # Errors
    /// As [`Self::solve_step`].
    pub fn run(&self, watch: &Watch) -> Result<Vec<StepSolution>, TrainError> {
        let solved = self.controlled()?.run(watch);
        self.problem.fault().map_or(solved, |fault| Err(fault.clone().into()))
    }
}
