//! How much of the statistical uncertainty an investor acts on.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Share of the radius that is used: a named level, or a number. `bold`, `balanced` and `cautious` are found by
/// simulation in three worlds: with no premium, with half of it, and with the whole of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CautionLevel {
    /// The whole radius, as in the paper.
    Paper,
    /// The share with the least worst regret, with double regret in the world with the whole premium.
    Bold,
    /// The share with the least worst regret over the three worlds.
    Balanced,
    /// The share with the least worst regret, with double regret in the world without a premium.
    Cautious,
    /// A fixed share, from 0 to 10, independent of the record. At 0 the record is taken as the true law.
    Scale(f64),
}

impl CautionLevel {
    /// The levels that are found from the record, the boldest first.
    pub const FOUND: [CautionLevel; 3] = [CautionLevel::Bold, CautionLevel::Balanced, CautionLevel::Cautious];

    /// Returns true if the share follows from the record.
    pub fn is_found(self) -> bool {
        CautionLevel::FOUND.contains(&self)
    }

    /// Returns the share of the radius, given the levels that were found. A level that was not found is the whole
    /// radius.
    pub fn share(self, found: Option<&CautionLevels>) -> f64 {
        match self {
            CautionLevel::Paper => 1.0,
            CautionLevel::Scale(scale) => scale,
            level => found.and_then(|levels| levels.of(level)).map_or(1.0, |level| level.scale),
        }
    }

    /// Returns the name used in requests.
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

/// The share of the radius at each level and its cost, found from the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CautionLevels {
    /// Mean simple return in excess of the bank, per step, in each of the three worlds: none, half, and the whole of a
    /// premium. That premium is the premium seen, or 0 if that is negative, plus its standard error.
    pub premiums: [f64; 3],
    /// Premium seen: the mean simple return of the record in excess of the bank, per step.
    pub premium_seen: f64,
    /// Standard error of the premium seen.
    pub standard_error: f64,
    /// The level `bold`: least worst regret, with double regret in the world with the whole premium.
    pub bold: CautionScale,
    /// The level `balanced`: least worst regret.
    pub balanced: CautionScale,
    /// The level `cautious`: least worst regret, with double regret in the world without a premium.
    pub cautious: CautionScale,
    /// The level `paper`: the whole radius.
    pub paper: CautionScale,
}

/// A share of the radius and its cost in the three worlds. Losses are in log certainty equivalent per step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CautionScale {
    /// Share of the radius.
    pub scale: f64,
    /// Standard error of the share, from the simulation of records.
    pub standard_error: f64,
    /// Loss relative to the best share in each of the three worlds: without a premium, with half, and with the whole.
    pub regrets: [f64; 3],
    /// Loss avoided relative to taking the record as the true law, in the world without a premium.
    pub spared: f64,
}

impl CautionLevels {
    /// Returns the share and cost of a level, if it is among these.
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

/// Largest share of the radius.
pub const LARGEST_SCALE: f64 = 10.0;
