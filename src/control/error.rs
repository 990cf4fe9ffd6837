//! Errors of the control floor. Only bad input and a numerical dead end are errors; a stop is an outcome.

use thiserror::Error;

/// A request field that breaks a rule: its path, its value and the rule.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{field} is {value}: {rule}")]
pub struct FieldError {
    /// Dotted path in the request, as in `problem.history[3]`.
    pub field: String,
    /// The offending value, rendered as JSON if it is JSON, shortened if it is long.
    pub value: String,
    /// The rule for the value, as a sentence without its subject: "must lie in (0, 1)".
    pub rule: String,
}

impl FieldError {
    /// Builds the error from a field named as in the request, its value, and the rule as a sentence without its
    /// subject.
    pub fn new(field: impl Into<String>, value: impl std::fmt::Display, rule: impl Into<String>) -> Self {
        FieldError { field: field.into(), value: value.to_string(), rule: rule.into() }
    }
}

/// The reason that ended a training.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TrainError {
    /// The request breaks a rule.
    #[error(transparent)]
    Specification(#[from] FieldError),
    /// The stop signal was raised.
    #[error("stopped on request")]
    Stopped,
    /// No diagonal made the covariance matrix of a surrogate positive definite.
    #[error("step {step}: the covariance matrix of the {surrogate} surrogate is singular even with jitter {jitter:e}")]
    Singular {
        /// The step being fitted.
        step: usize,
        /// `value` or `policy`.
        surrogate: &'static str,
        /// The last jitter tried, in squared units of the scaled target.
        jitter: f64,
    },
    /// A robust step has no finite solution.
    #[error(
        "step {step}, design point {point}: the robust step gave the gain {gain} and the action {action}, which are not both finite"
    )]
    NotFinite {
        /// The step being solved.
        step: usize,
        /// Its design point.
        point: usize,
        /// Log certainty equivalent over the floor.
        gain: f64,
        /// The policy's target.
        action: f64,
    },
}

/// The reason that stored or imported policy bytes are not a policy.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PolicyError {
    /// The bytes are not a document of the format; holds the parser's message.
    #[error("the policy is not valid JSON of its format: {0}")]
    Format(String),
    /// A part of the document breaks a rule.
    #[error(transparent)]
    Field(#[from] FieldError),
}
