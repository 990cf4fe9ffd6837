//! One solved step as it is stored: its solution, and how well it was solved.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::actions::Band;
use crate::control::surrogate::counts::LEAPS;
use crate::control::surrogate::stored::{SingleSolution, Solution};

/// Name and version of the portable form, which fixes the features and the radii that a policy was trained with.
pub const FORMAT: &str = "ballast-policy-1";

/// The stored data of one solved step; a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepSolution {
    /// Periods observed before this step.
    pub step: usize,
    /// The solution of the step.
    pub solution: Solution,
    /// Diagnostics of how well it was solved.
    pub diagnostics: StepDiagnostics,
}

/// Diagnostics of how well a step was solved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StepDiagnostics {
    /// Periods observed before this step.
    pub step: usize,
    /// Design points solved.
    pub design_count: usize,
    /// Share of the design points at which the robust allocation without previous holdings is zero.
    pub all_bank_share: f64,
    /// Share of the design points whose window could not be certified: mass might want to leave it.
    pub uncertified_share: f64,
    /// Largest difference between the primal and the dual value of a robust step, in log certainty equivalent; 0 in the
    /// parametric frameworks, whose step has no dual.
    pub duality_gap: f64,
    /// Expected error of the value, if an accuracy was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected_error: Option<ExpectedError>,
    /// Diagnostics of the value surrogate; absent if the step stores a single state's solution.
    pub value: Option<SurrogateDiagnostics>,
    /// Diagnostics of the policy surrogate; absent if the step stores a single state's solution.
    pub policy: Option<SurrogateDiagnostics>,
}

/// Root mean square errors of the value of a step, in basis points of the certainty equivalent, at any holding; for a
/// declared problem, unless its utility is power or log, in ten-thousandths of the size of its amounts. They
/// are over the design's own law of its states, of which one in eight leaps beyond the record: one or more of the returns
/// on the way to it may be anything within the support.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExpectedError {
    /// The error of the surrogate of the step alone.
    pub own: f64,
    /// The error with those of the steps after it. Along one record the errors of neighbouring steps are alike, so they
    /// add up to more than independent errors would: to 1.6 times as much over a dozen steps.
    pub total: f64,
}

impl ExpectedError {
    /// Returns the errors of the step before, whose surrogate alone errs by `own`. Neighbouring steps have laws that are
    /// alike, and so have their errors: their correlation is taken to be one half, and to halve with each step further.
    /// The later errors, each weighted by its correlation, then add up to about that of the next step, and to no more
    /// than half of their total.
    pub fn before(self, own: f64) -> Self {
        let alike = self.own.min(0.5 * self.total);
        ExpectedError { own, total: (own * own + 2.0 * own * alike + self.total * self.total).sqrt() }
    }

    /// Returns the error that the steps after add, in log certainty equivalent. At a state outside the design all
    /// of it may be that of the leaping states.
    pub fn later(self, in_design: bool) -> f64 {
        let share = if in_design { 1.0 } else { 1.0 / LEAPS as f64 };
        1e-4 * ((self.total * self.total - self.own * self.own).max(0.0) / share).sqrt()
    }
}

/// The figures of a fitted surrogate.
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
    /// Log likelihood of the scaled targets at the hyperparameters found, divided by their number.
    pub log_likelihood_per_point: f64,
    /// Root mean square of the leave-one-out errors of up to 500 design points, in the target's own unit.
    pub leave_one_out_error: f64,
    /// Diagonal added to the covariance matrix to factorise it, relative to its diagonal.
    pub jitter: f64,
    /// How the maximum-likelihood search ended.
    pub search: String,
}

/// The checkpoint of a solved step, with the format.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Checkpoint<F, S> {
    format: F,
    solution: S,
}

impl StepSolution {
    /// Returns a placeholder for a step whose own solution is never used: it holds nothing, and gains nothing.
    pub fn unsolved(step: usize) -> Self {
        StepSolution {
            step,
            solution: Solution::Single(SingleSolution { floor_gains: vec![0.0], band: Band::of(&[0.0]) }),
            diagnostics: StepDiagnostics {
                step,
                design_count: 1,
                all_bank_share: 1.0,
                uncertified_share: 0.0,
                duality_gap: 0.0,
                expected_error: None,
                value: None,
                policy: None,
            },
        }
    }

    /// Writes JSON whose numbers parse back to the same bits, with the format of the policy that the step will be part
    /// of.
    ///
    /// # Errors
    /// None for plain structs of numbers and strings.
    pub fn to_checkpoint(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(&Checkpoint { format: FORMAT, solution: self })
    }

    /// Reads a checkpoint; `None` if the bytes are of another format, whose features or radii differ: one policy has
    /// steps of one format.
    pub fn from_checkpoint(bytes: &[u8]) -> Option<Self> {
        let Checkpoint { format, solution } = serde_json::from_slice::<Checkpoint<String, StepSolution>>(bytes).ok()?;
        (format == FORMAT).then_some(solution)
    }
}
