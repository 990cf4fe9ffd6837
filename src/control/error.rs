//! Errors of the control floor. Only bad input and a numerical dead end are errors; a stop is an outcome.

use thiserror::Error;

/// A request field that breaks a rule: which, what it held, what it must be.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{field} is {value}: {rule}")]
pub struct FieldError {
    /// Dotted path in the request, as in `problem.history[3]`.
    pub field: String,
    /// The offending value, rendered as JSON where it is one, shortened where it is long.
    pub value: String,
    /// What the value must be, as a sentence without its subject: "must lie in (0, 1)".
    pub rule: String,
}

impl FieldError {
    pub fn new(field: impl Into<String>, value: impl std::fmt::Display, rule: impl Into<String>) -> Self {
        FieldError { field: field.into(), value: value.to_string(), rule: rule.into() }
    }
}

/// Why a training could not go on.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TrainError {
    #[error(transparent)]
    Specification(#[from] FieldError),
    /// The stop signal was raised.
    #[error("stopped on request")]
    Stopped,
    #[error("step {step}: the covariance matrix of the {surrogate} surrogate is singular even with jitter {jitter:e}")]
    Singular { step: usize, surrogate: &'static str, jitter: f64 },
    #[error(
        "step {step}, design point {point}: the robust step gave the gain {gain} for the action {action}: not both finite"
    )]
    NotFinite { step: usize, point: usize, gain: f64, action: f64 },
}

/// Why stored or imported policy bytes are not a policy.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PolicyError {
    #[error("the policy is not valid JSON of its format: {0}")]
    Format(String),
    #[error(transparent)]
    Field(#[from] FieldError),
    #[error("a policy surrogate's covariance matrix cannot be factorised at step {step}")]
    Singular { step: usize },
}
