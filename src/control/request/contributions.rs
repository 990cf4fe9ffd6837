//! Money that is added and withdrawn.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// C, the money added at the end of each period, or withdrawn if negative: one number for all periods, or a list with
/// one number for each. Default 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged, expecting = "must be a number or a list of numbers")]
pub enum Contributions {
    /// One amount for all periods.
    Each(f64),
    /// One amount for each period.
    Listed(Vec<f64>),
}

impl Default for Contributions {
    fn default() -> Self {
        Contributions::Each(0.0)
    }
}

impl Contributions {
    /// Returns the amount added at the end of period `step + 1`.
    pub fn at(&self, step: usize) -> f64 {
        match self {
            Contributions::Each(amount) => *amount,
            Contributions::Listed(amounts) => amounts.get(step).copied().unwrap_or_default(),
        }
    }

    /// Replaces a list of equal amounts by the single amount.
    #[must_use]
    pub fn canonical(self) -> Self {
        match &self {
            Contributions::Listed(amounts) => match amounts.split_first() {
                Some((first, rest)) if rest.iter().all(|amount| amount == first) => Contributions::Each(*first),
                _ => self,
            },
            Contributions::Each(_) => self,
        }
    }

    /// Returns true if nothing is ever added or withdrawn.
    pub fn are_none(&self) -> bool {
        match self {
            Contributions::Each(amount) => *amount == 0.0,
            Contributions::Listed(amounts) => amounts.iter().all(|amount| *amount == 0.0),
        }
    }
}
