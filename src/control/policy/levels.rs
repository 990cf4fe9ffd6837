//! The advice at each level of caution, and its cost.

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::request::caution::{CautionLevel, CautionLevels, CautionScale};

/// The levels of caution on a record.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct LevelsAdvised {
    /// The level that is followed.
    pub followed: CautionLevel,
    /// Mean simple return of the record beyond the bank, per step.
    pub premium_seen: f64,
    /// Standard error of this premium.
    pub standard_error: f64,
    /// Mean simple return beyond the bank in the three worlds for which losses are reported: none, half, and the whole
    /// of the observed premium plus its standard error. A negative premium counts as 0.
    pub premiums: [f64; 3],
    /// The levels, from the boldest to the paper's.
    pub levels: Vec<LevelAdvised>,
}

/// A level, its share of the radius, its price, and its allocation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct LevelAdvised {
    /// Name of the level.
    pub level: CautionLevel,
    /// Share of the radius.
    pub scale: f64,
    /// Loss of log certainty equivalent per step against the best share of the radius, in the three worlds.
    pub regrets: [f64; 3],
    /// Gain per step in the world without a premium, against taking the record as true.
    pub spared: f64,
    /// Share of wealth that the level would hold; null if it would take long to compute, for several assets in long
    /// records.
    pub allocation: Option<f64>,
    /// Standard error of the allocation, from the simulation behind the level; only for the level that is followed.
    pub allocation_error: Option<f64>,
}

/// Why an advice holds nothing. For several assets, the figures are those of the inverse-volatility fund.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct WhyNothing {
    /// Mean simple return of the record beyond the bank, per step.
    pub premium_seen: f64,
    /// Standard error of this premium.
    pub standard_error: f64,
    /// The least mean excess return under the laws in the ball: 0 or less, unless trading costs something. Null for
    /// several assets, for which `worst_means` gives it asset by asset.
    pub premium_left: Option<f64>,
    /// Share of wealth held within half of the radius, in all assets together; null if the radius is not simulated.
    pub at_half_the_caution: Option<f64>,
}

impl LevelsAdvised {
    /// Builds the summary of levels that were computed; `allocation` returns the advised allocation at a share of the
    /// radius.
    pub fn of(found: &CautionLevels, followed: CautionLevel, mut allocation: impl FnMut(f64) -> Option<f64>) -> Self {
        let levels = CautionLevel::FOUND.into_iter().chain([CautionLevel::Paper]).filter_map(|level| {
            let CautionScale { scale, standard_error, regrets, spared } = found.of(level)?;
            let mut beside = |error: f64| allocation((scale + error).clamp(0.0, 1.0));
            let allocation_error = match level == followed {
                true => {
                    beside(standard_error).zip(beside(-standard_error)).map(|(more, less)| 0.5 * (more - less).abs())
                }
                false => None,
            };
            Some(LevelAdvised { level, scale, regrets, spared, allocation: beside(0.0), allocation_error })
        });
        let CautionLevels { premium_seen, standard_error, premiums, .. } = *found;
        LevelsAdvised { followed, premium_seen, standard_error, premiums, levels: levels.collect() }
    }
}
