//! The centre of a ball of laws.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::sampling_law::SamplingLaw;

/// The centre of the ball of laws, built from the returns seen: those of the history and those seen later.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CentreSpecification {
    /// The empirical law of the returns seen.
    Empirical {},
    /// The perturbed empirical law: a return seen plus a normal error. Its radius is that of the returns seen, because
    /// smoothing does not add returns.
    Smoothed {
        /// Standard deviation of the error, in log-return, 0 to 1. At 0 the centre is that of `empirical`.
        bandwidth: f64,
    },
    /// The law of the returns seen, each rescaled to the volatility expected for the coming period. That volatility is
    /// estimated by an exponentially weighted mean of squares. This needs the framework `static` or one period, because
    /// the effect of later returns on the volatility is not part of a state.
    VolatilityScaled {
        /// Number of periods in which the weight of a square halves, 1 to 1e15.
        half_life: f64,
    },
    /// The law of the returns seen at times like the present: a return has the weight `exp(-(d / bandwidth)^2 / 2)`, times
    /// that of its age, with d how far what was known before it is from what is known now, in standard deviations. Its
    /// radius is that of the weighted bridge. This needs the framework `static` or one period, because what will be known
    /// later is not part of a state.
    Conditional {
        /// A figure that tells times apart.
        on: Covariate,
        /// Standard deviations at which a return has the weight 0.6, 0.05 to 1e15. Widened if fewer than 30 returns would
        /// count. Without bound the centre is that of `empirical`.
        bandwidth: f64,
    },
    /// The law of the returns seen, mixed with an assumed law that counts as additional returns. Exactly one of `law`
    /// and `history` is given. With n returns seen the radius is theirs times n / (n + weight): the ball allows for
    /// what they may miss. The assumed law is the user's assumption, and the ball does not allow for its error.
    Mixed {
        /// The assumed law as a formula. `bootstrap` is rejected, because the returns seen are already counted.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        law: Option<SamplingLaw>,
        /// The assumed law as log-returns of equal weight, from another market or a longer record: 2 to 20,000 values.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        history: Option<Vec<f64>>,
        /// Number of returns that the assumed law counts as, 0 to 1,000,000. At 0 the centre is that of `empirical`.
        weight: f64,
    },
}

/// A figure known before each period that tells times apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Covariate {
    /// The exponentially weighted mean of the log-returns before.
    Trend {
        /// Number of periods in which the weight of a return halves, 1 to 1e15.
        half_life: f64,
    },
    /// The root of the exponentially weighted mean of their squares.
    Volatility {
        /// Number of periods in which the weight of a square halves, 1 to 1e15.
        half_life: f64,
    },
    /// Numbers of your own.
    Column {
        /// The figure before each return of the history, oldest first, and the present one: one number more than the
        /// history has.
        values: Vec<f64>,
    },
}

impl Covariate {
    /// Returns the name used in requests.
    pub fn name(&self) -> &'static str {
        match self {
            Covariate::Trend { .. } => "trend",
            Covariate::Volatility { .. } => "volatility",
            Covariate::Column { .. } => "column",
        }
    }

    /// Returns what it is in a sentence.
    fn noun(&self) -> &'static str {
        match self {
            Covariate::Column { .. } => "given figure",
            other => other.name(),
        }
    }
}

impl Default for CentreSpecification {
    fn default() -> Self {
        CentreSpecification::Empirical {}
    }
}

impl CentreSpecification {
    /// Returns the name used in requests.
    pub fn name(&self) -> &'static str {
        match self {
            CentreSpecification::Empirical {} => "empirical",
            CentreSpecification::Smoothed { .. } => "smoothed",
            CentreSpecification::VolatilityScaled { .. } => "volatility_scaled",
            CentreSpecification::Conditional { .. } => "conditional",
            CentreSpecification::Mixed { .. } => "mixed",
        }
    }

    /// Returns true if the centre is named `empirical`.
    pub fn is_empirical(&self) -> bool {
        *self == CentreSpecification::Empirical {}
    }

    /// Returns true if the centre depends on the order of the returns, which the law of the returns seen does not keep.
    pub fn takes_order(&self) -> bool {
        matches!(self, CentreSpecification::VolatilityScaled { .. } | CentreSpecification::Conditional { .. })
    }

    /// Returns true if the centre has numbers that belong to the returns of one history, so that no other may replace it.
    pub fn has_column(&self) -> bool {
        matches!(self, CentreSpecification::Conditional { on: Covariate::Column { .. }, .. })
    }

    /// Returns the number of returns that the assumed law counts as; 0 without one.
    pub fn assumed_weight(&self) -> f64 {
        match self {
            CentreSpecification::Mixed { weight, .. } => *weight,
            _ => 0.0,
        }
    }

    /// Returns the share that `size` returns seen have in the centre, `size / (size + weight)`. The radius bounds the
    /// distance of their law from the law they are drawn from. Mixing the assumed law into both multiplies that
    /// distance by this share.
    pub fn share_seen(&self, size: f64) -> f64 {
        size / (size + self.assumed_weight())
    }

    /// Describes the centre of the ball in words, for a number of returns seen.
    pub fn in_words(&self, sample_size: usize) -> String {
        let more = match self {
            CentreSpecification::Empirical {} => String::new(),
            CentreSpecification::Smoothed { bandwidth } => {
                format!(", each with a normal error of deviation {bandwidth},")
            }
            CentreSpecification::VolatilityScaled { .. } => ", each rescaled to today's volatility,".to_owned(),
            CentreSpecification::Conditional { on, .. } => {
                format!(", weighted by how much the {} before each was like that of today,", on.noun())
            }
            CentreSpecification::Mixed { weight, .. } => {
                format!(" and the assumed law that counts as {weight} more")
            }
        };
        format!("the {sample_size} returns seen{more}")
    }
}
