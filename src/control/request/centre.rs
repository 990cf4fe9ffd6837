//! What a ball of laws is centred on.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::sampling_law::SamplingLaw;

/// The law in the middle of the ball, made of the law of the returns seen: those of the history and those seen after it alike.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CentreSpecification {
    /// The law of the returns seen.
    Empirical {},
    /// The perturbed empirical law: that of a return seen plus a normal error. Its radius is that of the returns seen, of which
    /// smoothing makes no more.
    Smoothed {
        /// Standard deviation of the error, in log-return. 0 is `empirical`.
        bandwidth: f64,
    },
    /// The law of the returns seen, each brought to the volatility that is expected for the coming period: of an exponentially
    /// weighted mean of squares. Of a static ball, or for one period: what a return yet to come does to the volatility is no part of
    /// a state.
    VolatilityScaled {
        /// Periods in which the weight of a square halves.
        half_life: f64,
    },
    /// The law of the returns seen, mixed with one that counts as so many more. Exactly one of `law` and `history` is given. With n
    /// returns seen the radius is theirs times n / (n + weight): the ball allows for what they may miss. That returns are drawn from
    /// the law given is the user's assumption, and the ball does not allow for its error.
    Mixed {
        /// As a formula. `bootstrap` is refused: what the returns seen say is counted already.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        law: Option<SamplingLaw>,
        /// As log-returns, all of the same weight: of another market, or of a longer record.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        history: Option<Vec<f64>>,
        /// Returns that the law given counts as. 0 is `empirical`.
        weight: f64,
    },
}

impl Default for CentreSpecification {
    fn default() -> Self {
        CentreSpecification::Empirical {}
    }
}

impl CentreSpecification {
    /// As the wire names it.
    pub fn name(&self) -> &'static str {
        match self {
            CentreSpecification::Empirical {} => "empirical",
            CentreSpecification::Smoothed { .. } => "smoothed",
            CentreSpecification::VolatilityScaled { .. } => "volatility_scaled",
            CentreSpecification::Mixed { .. } => "mixed",
        }
    }

    /// Whether it is named `empirical`.
    pub fn is_empirical(&self) -> bool {
        *self == CentreSpecification::Empirical {}
    }

    /// Whether it takes the order of returns, which the law of those seen does not keep.
    pub fn takes_order(&self) -> bool {
        matches!(self, CentreSpecification::VolatilityScaled { .. })
    }

    /// Returns that a law counts as which nobody has seen.
    pub fn assumed_weight(&self) -> f64 {
        match self {
            CentreSpecification::Mixed { weight, .. } => *weight,
            _ => 0.0,
        }
    }

    /// The share of the centre that `size` returns seen have, `size / (size + weight)`: their law is as far from the one they are
    /// drawn from as the radius says, and the centre is as far from that one, mixed alike, times this share.
    pub fn share_seen(&self, size: f64) -> f64 {
        size / (size + self.assumed_weight())
    }

    /// What stands in the middle of the ball, of so many returns seen, in words.
    pub fn in_words(&self, sample_size: usize) -> String {
        let more = match self {
            CentreSpecification::Empirical {} => String::new(),
            CentreSpecification::Smoothed { bandwidth } => {
                format!(", each with a normal error of deviation {bandwidth},")
            }
            CentreSpecification::VolatilityScaled { .. } => ", each at the volatility of now,".to_owned(),
            CentreSpecification::Mixed { weight, .. } => {
                format!(" and the law that is assumed to tell as much as {weight} more")
            }
        };
        format!("the {sample_size} returns seen{more}")
    }
}
