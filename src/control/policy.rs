//! A trained policy: immutable, portable, named by the hash of its bytes.  (STUB BODIES)

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use super::backward::StepSolution;
use super::error::PolicyError;
use super::specification::Specification;

/// The completed specification and the solution of every step, in ascending order of step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Policy {
    format: String,
    specification: Specification,
    steps: Vec<StepSolution>,
}

/// How well a step was solved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StepDiagnostics {
    pub step: usize,
    pub design_count: usize,
    /// Share of the design points at which the robust allocation is zero.
    pub all_bank_share: f64,
    /// Largest difference between the primal and the dual value of a robust step, in log certainty equivalent.
    pub duality_gap: f64,
    /// Diagnostics of the value surrogate; absent where the step stores a single state's solution.
    pub value: Option<SurrogateDiagnostics>,
    /// Diagnostics of the policy surrogate; absent where the step stores a single state's solution.
    pub policy: Option<SurrogateDiagnostics>,
}

/// A fitted surrogate in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SurrogateDiagnostics {
    /// Names of the inputs, in the order of the lengthscales.
    pub features: Vec<String>,
    /// Lengthscales in units of each input's standard deviation over the design.
    pub lengthscales: Vec<f64>,
    /// In units of the target's variance over the design.
    pub signal_variance: f64,
    /// In units of the target's variance over the design.
    pub noise_variance: f64,
    pub log_likelihood_per_point: f64,
    /// Root mean square of the leave-one-out errors, in the target's own unit.
    pub leave_one_out_error: f64,
    /// Diagonal added to the covariance matrix to factorise it, relative to its diagonal.
    pub jitter: f64,
    /// How the maximum-likelihood search ended.
    pub search: String,
}

impl Policy {
    pub fn new(specification: Specification, steps: Vec<StepSolution>) -> Self {
        Policy { format: "ballast-policy-1".into(), specification, steps }
    }

    /// The completed specification it was trained from.
    pub fn specification(&self) -> &Specification {
        &self.specification
    }

    /// Diagnostics of every step, ascending.
    pub fn diagnostics(&self) -> impl Iterator<Item = &StepDiagnostics> {
        self.steps.iter().map(|step| &step.diagnostics)
    }

    /// The portable form: JSON whose numbers parse back to the same bits.
    pub fn to_json(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Reads and checks the portable form as hostile input: format, shapes, finite numbers, the specification's rules.
    pub fn from_json(bytes: &[u8]) -> Result<Self, PolicyError> {
        serde_json::from_slice(bytes).map_err(|error| PolicyError::Format(error.to_string()))
    }
}

/// SHA-256 of a policy's portable form, in lower-case hexadecimal: the policy's name.
pub fn content_hash(json: &[u8]) -> String {
    Sha256::digest(json).iter().map(|byte| format!("{byte:02x}")).collect()
}
