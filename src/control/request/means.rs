//! The means that the law of several assets has.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The means of the assets under the law at the centre of the ball. Shrunk means move every return of an asset by the same
/// factor; risks and correlations stay. They are found anew with each return. Default: `sample`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum MeansRule {
    /// The means of the returns seen.
    Sample {},
    /// The means moved towards their average over the assets.
    Shrunk {
        /// Share of the way, 0 to 1. At 0 the means are those of `sample`, at 1 all assets have one mean.
        intensity: f64,
    },
    /// The means moved towards that of the minimum-variance portfolio, as far as the record's noise says (Jorion 1986).
    BayesStein {},
}

impl Default for MeansRule {
    fn default() -> Self {
        MeansRule::Sample {}
    }
}

impl MeansRule {
    /// Returns the name used in requests.
    pub fn name(&self) -> &'static str {
        match self {
            MeansRule::Sample {} => "sample",
            MeansRule::Shrunk { .. } => "shrunk",
            MeansRule::BayesStein {} => "bayes_stein",
        }
    }

    /// Returns true if the means are those of the returns seen.
    pub fn is_sample(&self) -> bool {
        *self == MeansRule::Sample {}
    }
}
