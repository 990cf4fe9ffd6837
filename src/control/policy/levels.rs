//! What each level of caution would advise, and what it costs.

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::request::caution::{CautionLevel, CautionLevels, CautionScale};

/// The levels of caution on a record.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct LevelsAdvised {
    /// The one followed.
    pub followed: CautionLevel,
    /// Mean simple return of the record beyond the bank, per step.
    pub premium_seen: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// The same beyond the bank in the three worlds that losses are told for: none, half, and the whole of the premium seen, or of 0
    /// where it is negative, plus its standard error.
    pub premiums: [f64; 3],
    /// From the boldest to the paper's.
    pub levels: Vec<LevelAdvised>,
}

/// A level, its share of the radius, its price, and what it would hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct LevelAdvised {
    /// Its name.
    pub level: CautionLevel,
    /// Share of the radius.
    pub scale: f64,
    /// Loss of log certainty equivalent per step beside the best share of the radius, in the three worlds.
    pub regrets: [f64; 3],
    /// Spared per step in the world without a premium, beside taking the record for the truth.
    pub spared: f64,
    /// Share of wealth that it would hold; null where that would take long to find, of several assets in long records.
    pub allocation: Option<f64>,
    /// Its standard error, of the simulation behind the level; of the level followed alone.
    pub allocation_error: Option<f64>,
}

/// Why an advice holds nothing: of several assets by the fund of inverse volatilities.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct WhyNothing {
    /// Mean simple return of the record beyond the bank, per step.
    pub premium_seen: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// The least that it is under the laws in the ball: 0 or less, unless what is bought or sold costs something. Null of several
    /// assets, of each of which `worst_means` tells it.
    pub premium_left: Option<f64>,
    /// Share of wealth that would be held within half of the radius, in all assets together; null where the radius is not simulated.
    pub at_half_the_caution: Option<f64>,
}

impl LevelsAdvised {
    /// Of levels that were found; `allocation` is what is advised at a share of the radius.
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
