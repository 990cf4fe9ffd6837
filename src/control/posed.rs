//! A problem as it is posed for a training: an investor's, or one declared in formulas.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::cache::Cache;
use super::declared_training::DeclaredTraining;
use super::error::FieldError;
use super::estimate::{self, Footprint};
use super::request::annualised::Annualised;
use super::request::declared::DeclaredSpecification;
use super::request::framework::Framework;
use super::request::specification::Specification;
use super::request::warnings::Warning;

/// A problem that a policy is trained for, with all settings of the training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum Posed {
    /// An investor's problem, with one asset or several.
    Investor(Box<Specification>),
    /// A problem declared in formulas.
    Declared(Box<DeclaredSpecification>),
}

/// A problem with every default filled in, and what is known before its training.
pub struct Completed {
    /// The problem.
    pub posed: Posed,
    /// Memory that the training takes.
    pub training: Footprint,
    /// Memory that the policy takes as long as it is used.
    pub advising: [Footprint; 3],
    /// Valid entries that may be mistakes.
    pub warnings: Vec<Warning>,
}

impl Posed {
    /// Fills in every default, and says what a training on so many threads takes.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn completed(self, threads: usize) -> Result<Completed, FieldError> {
        Ok(match self {
            Posed::Investor(specification) => {
                let completed = specification.completed()?;
                let (training, advising) = (estimate::training(&completed, threads), estimate::advising(&completed));
                let estimated = completed.fund.as_ref().and_then(|fund| fund.history.warning(&fund.assets));
                let warnings = completed.problem.warnings().into_iter().chain(estimated).collect();
                Completed { posed: Posed::Investor(completed.into()), training, advising, warnings }
            }
            Posed::Declared(declared) => {
                let read = DeclaredTraining::with(&declared, Cache::default())?;
                let (training, advising) = estimate::declared::training(&read, threads);
                let (posed, warnings) = (Posed::Declared(read.declared().clone().into()), read.warnings());
                Completed { posed, training, advising, warnings }
            }
        })
    }

    /// Returns the number of steps that a training solves: the first step of a declared problem is solved on request.
    pub fn step_count(&self) -> usize {
        match self {
            Posed::Investor(specification) => specification.problem.horizon,
            Posed::Declared(declared) => declared.problem.horizon.saturating_sub(1).max(1),
        }
    }

    /// Returns the number of decisions.
    pub fn horizon(&self) -> usize {
        match self {
            Posed::Investor(specification) => specification.problem.horizon,
            Posed::Declared(declared) => declared.problem.horizon,
        }
    }

    /// Returns the framework.
    pub fn framework(&self) -> Framework {
        match self {
            Posed::Investor(specification) => specification.problem.framework,
            Posed::Declared(declared) => declared.problem.framework,
        }
    }

    /// Returns annual figures, if the length of a period is given.
    pub fn annualised(&self) -> Option<Annualised> {
        match self {
            Posed::Investor(specification) => specification.problem.annualised(),
            Posed::Declared(_) => None,
        }
    }
}
