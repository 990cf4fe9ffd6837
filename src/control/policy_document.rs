//! A policy of any problem, as it is stored, imported and kept ready.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::cache::Cache;
use super::error::{FieldError, PolicyError};
use super::estimate::{self, Footprint};
use super::policy::Policy;
use super::policy::advisor::Advisor;
use super::policy::declared::{DeclaredAdvisor, DeclaredPolicy, FORMAT};
use super::posed::Posed;
use super::request::warnings::Warning;
use super::solved_step::StepDiagnostics;

/// The document of a policy. Its `format` says which it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PolicyDocument {
    /// An investor's.
    Investor(Box<Policy>),
    /// A declared problem's.
    Declared(Box<DeclaredPolicy>),
}

/// A policy ready to answer.
#[derive(Clone)]
pub enum PreparedPolicy {
    /// An investor's.
    Investor(Arc<Advisor>),
    /// A declared problem's.
    Declared(Arc<DeclaredAdvisor>),
}

impl PolicyDocument {
    /// Returns the portable form: JSON whose numbers parse back to the same bits.
    ///
    /// # Errors
    /// None that plain structs of numbers and strings can cause.
    pub fn to_json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    /// Returns true if the bytes have the format of a declared problem's policy.
    pub fn is_declared(bytes: &[u8]) -> bool {
        #[derive(Deserialize)]
        struct Formatted {
            format: String,
        }
        serde_json::from_slice::<Formatted>(bytes).is_ok_and(|document| document.format == FORMAT)
    }

    /// Reads the portable form. It is checked when it is prepared.
    ///
    /// # Errors
    /// The bytes are not JSON of the format that they name.
    pub fn from_json(bytes: &[u8]) -> Result<Self, PolicyError> {
        let format = |error: serde_json::Error| PolicyError::Format(error.to_string());
        match PolicyDocument::is_declared(bytes) {
            true => serde_json::from_slice(bytes).map(PolicyDocument::Declared).map_err(format),
            false => serde_json::from_slice(bytes).map(PolicyDocument::Investor).map_err(format),
        }
    }

    /// Checks the document as hostile input, and returns the memory that answers take, including the policy itself.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn checked(self) -> Result<(Self, [Footprint; 3]), FieldError> {
        match self {
            PolicyDocument::Investor(policy) => {
                let policy = policy.checked()?;
                let bytes = estimate::advising_by(&policy);
                Ok((PolicyDocument::Investor(policy.into()), bytes))
            }
            PolicyDocument::Declared(policy) => {
                let bytes = estimate::declared::advising_by(&policy, &policy.checked(Cache::default())?);
                Ok((PolicyDocument::Declared(policy), bytes))
            }
        }
    }

    /// Checks the document as hostile input, and returns the policy ready to answer.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn prepared(self, kept: Cache) -> Result<PreparedPolicy, FieldError> {
        Ok(match self {
            PolicyDocument::Investor(policy) => PreparedPolicy::Investor(Advisor::with(policy.checked()?, kept).into()),
            PolicyDocument::Declared(policy) => PreparedPolicy::Declared(policy.prepared(kept)?.into()),
        })
    }
}

impl PreparedPolicy {
    /// Returns the bytes that it takes, without bridges and factors.
    pub fn bytes(&self) -> usize {
        match self {
            PreparedPolicy::Investor(advisor) => advisor.bytes(),
            PreparedPolicy::Declared(advisor) => advisor.bytes(),
        }
    }

    /// Returns the completed specification.
    pub fn posed(&self) -> Posed {
        match self {
            PreparedPolicy::Investor(advisor) => Posed::Investor(advisor.specification().clone().into()),
            PreparedPolicy::Declared(advisor) => Posed::Declared(advisor.policy().specification().clone().into()),
        }
    }

    /// Returns valid entries of the specification that may be mistakes.
    pub fn warnings(&self) -> Vec<Warning> {
        match self {
            PreparedPolicy::Investor(advisor) => advisor.specification().problem.warnings(),
            PreparedPolicy::Declared(advisor) => advisor.warnings().to_vec(),
        }
    }

    /// Returns the diagnostics of every trained step, ascending.
    pub fn diagnostics(&self) -> Vec<StepDiagnostics> {
        match self {
            PreparedPolicy::Investor(advisor) => advisor.policy().diagnostics().cloned().collect(),
            PreparedPolicy::Declared(advisor) => advisor.policy().diagnostics().cloned().collect(),
        }
    }
}
