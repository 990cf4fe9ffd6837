//! Laws that returns can be drawn from.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A law of log-returns that can be drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SamplingLaw {
    /// A mixture of normal laws.
    GaussianMixture {
        /// Components of the mixture, 1 to 32; their weights sum to 1.
        components: Vec<MixtureComponent>,
    },
    /// Smoothed bootstrap of the history with the weights of its returns, with the same weighted mean and variance.
    Bootstrap {},
    /// A Student t law, shifted and scaled.
    StudentT {
        /// Mean, in log-return per step, -1 to 1.
        location: f64,
        /// Factor on a standard t variable, in log-return, 1e-6 to 1.
        scale: f64,
        /// Degrees of freedom, 2.1 to 1e6: above 2 the variance is finite.
        degrees_of_freedom: f64,
    },
}

/// One normal law of a mixture, of log-returns per step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MixtureComponent {
    /// Probability of the component, above 0 and at most 1.
    pub weight: f64,
    /// Mean, in log-return, -1 to 1.
    pub mean: f64,
    /// Variance, in squared log-return, 1e-12 to 1.
    pub variance: f64,
}
