//! Laws that returns can be drawn from.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A law of log-returns that can be drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SamplingLaw {
    /// A mixture of normal laws.
    GaussianMixture {
        /// At least one; their weights sum to 1.
        components: Vec<MixtureComponent>,
    },
    /// Smoothed bootstrap of the history, each return with its weight, with the mean and variance that gives.
    Bootstrap {},
    /// A Student t law, moved and stretched.
    StudentT {
        /// Its mean, in log-return per step.
        location: f64,
        /// What a standard t variable is multiplied by, in log-return.
        scale: f64,
        /// Above 2: its variance is finite.
        degrees_of_freedom: f64,
    },
}

/// One normal law of a mixture, of log-returns per step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MixtureComponent {
    /// Its probability.
    pub weight: f64,
    /// In log-return.
    pub mean: f64,
    /// In squared log-return.
    pub variance: f64,
}
