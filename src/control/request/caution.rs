//! How much of the statistical doubt an investor acts on.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The share of the radius that is acted on: a level by its name, or a number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CautionLevel {
    /// The whole radius: the paper's.
    Paper,
    /// The share of least worst regret, where regret counts twice if the record is true.
    Bold,
    /// The share of least worst regret.
    Balanced,
    /// The share of least worst regret, where regret counts twice if there is no premium.
    Cautious,
    /// This share, whatever is seen: 0 takes the record for the truth.
    Scale(f64),
}

impl CautionLevel {
    /// The levels that are found, from the boldest.
    pub const FOUND: [CautionLevel; 3] = [CautionLevel::Bold, CautionLevel::Balanced, CautionLevel::Cautious];

    /// Whether its share follows from the record.
    pub fn is_found(self) -> bool {
        CautionLevel::FOUND.contains(&self)
    }

    /// Of the radius, where these levels were found; a level that was not is the whole of it.
    pub fn share(self, found: Option<&CautionLevels>) -> f64 {
        match self {
            CautionLevel::Paper => 1.0,
            CautionLevel::Scale(scale) => scale,
            level => found.and_then(|levels| levels.of(level)).map_or(1.0, |level| level.scale),
        }
    }

    /// As on the wire.
    pub fn name(self) -> &'static str {
        match self {
            CautionLevel::Paper => "paper",
            CautionLevel::Bold => "bold",
            CautionLevel::Balanced => "balanced",
            CautionLevel::Cautious => "cautious",
            CautionLevel::Scale(_) => "scale",
        }
    }
}

/// The shares of the radius that the levels act on, and what each costs, found from the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CautionLevels {
    /// Mean simple returns beyond the bank, per step, that the three worlds are supposed to have: none, half, and one of the
    /// premium seen, or 0 where it is negative, plus its standard error.
    pub premiums: [f64; 3],
    /// Premium seen: the mean simple return of the record beyond the bank, per step.
    pub premium_seen: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Least worst regret, double regret in the world of the whole premium.
    pub bold: CautionScale,
    /// Least worst regret.
    pub balanced: CautionScale,
    /// Least worst regret, double regret in the world without a premium.
    pub cautious: CautionScale,
    /// The whole radius.
    pub paper: CautionScale,
}

/// A share of the radius and its price in the three worlds. Losses are in log certainty equivalent per step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CautionScale {
    /// Share of the radius.
    pub scale: f64,
    /// Its standard error, of the simulation of records.
    pub standard_error: f64,
    /// Loss beside the best share in each of the three worlds: without a premium, with half, and with the whole.
    pub regrets: [f64; 3],
    /// Spared beside taking the record for the truth, in the world without a premium.
    pub spared: f64,
}

impl CautionLevels {
    /// That of a level, where it is among these.
    pub fn of(&self, level: CautionLevel) -> Option<CautionScale> {
        match level {
            CautionLevel::Paper => Some(self.paper),
            CautionLevel::Bold => Some(self.bold),
            CautionLevel::Balanced => Some(self.balanced),
            CautionLevel::Cautious => Some(self.cautious),
            CautionLevel::Scale(_) => None,
        }
    }
}

/// A share of the radius at most.
pub const LARGEST_SCALE: f64 = 10.0;
