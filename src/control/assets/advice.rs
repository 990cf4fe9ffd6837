//! The advice of one robust step with several assets, by name.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::AssetsSolution;
use crate::control::policy::caution::Caution;
use crate::control::policy::levels::LevelsAdvised;

/// The allocation over several assets through the coming period.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsAdvice {
    /// Share of wealth in each asset; the rest is in the bank.
    pub allocation: BTreeMap<String, f64>,
    /// The allocation less the holdings: shares of wealth to buy, or to sell if negative.
    pub trade: BTreeMap<String, f64>,
    /// Share of each asset in the holdings advised; if these are next to nothing, the shares by inverse volatility.
    pub composition: BTreeMap<String, f64>,
    /// Share of wealth in all assets together.
    pub total: f64,
    /// `total` if no log-return could fall below the lowest seen of any asset. Its excess over `total` is the part of
    /// the caution against a crash that nobody has seen. Null if `problem.support` rules one out already.
    pub without_crash: Option<f64>,
    /// Lower bound on the certain wealth that is worth as much as the allocation against the worst law, less trading
    /// costs.
    pub certainty_equivalent: f64,
    /// No allocation is worth more than this.
    pub bound: f64,
    /// Wealth from selling everything now and staying in the bank.
    pub floor: f64,
    /// Radius of the ball, in log-return.
    pub radius: f64,
    /// Factor by which the radius of the fund of inverse volatilities is widened to hold for all funds at once. The
    /// search for it may end too low: by little if assets move together, by more than a tenth for a dozen that are
    /// independent.
    pub radius_factor: f64,
    /// The levels of caution, if one of them is followed: found for the fund of inverse volatilities.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<LevelsAdvised>,
    /// Number of dates seen.
    pub sample_size: usize,
    /// The mean of each asset under the law behind `bound`, which is the worst law if the two bounds meet.
    pub worst_means: BTreeMap<String, WorstMean>,
    /// Warnings to read before following the advice.
    pub caution: Vec<Caution>,
}

/// The one-step problem of several assets, by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OneStep {
    /// Shares of wealth that are best when looking one period ahead.
    pub allocation: BTreeMap<String, f64>,
    /// Lower bound on the certain wealth after the period that is worth as much as they are against the worst law.
    pub certainty_equivalent: f64,
    /// No allocation is worth more than this.
    pub bound: f64,
    /// The mean of each asset under the worst law.
    pub worst_means: BTreeMap<String, WorstMean>,
    /// Warnings to read before following the allocation; left out if there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub caution: Vec<Caution>,
}

/// The mean of an asset's log-return.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstMean {
    /// The mean of the log-returns seen.
    pub seen: f64,
    /// The mean under the law at the centre of the ball, if `problem.means` moves it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub believed: Option<f64>,
    /// The mean under the worst law.
    pub worst: f64,
}

/// Returns the values by the names of the assets.
pub fn named<T: Copy>(names: &[String], values: &[T]) -> BTreeMap<String, T> {
    names.iter().cloned().zip(values.iter().copied()).collect()
}

/// Returns the mean of each asset: over the log-returns `seen`, over those of the law at the centre, and under the law
/// behind the bound of a solution.
pub fn worst_means(
    names: &[String],
    seen: &[Vec<f64>],
    centre: &[Vec<f64>],
    solution: &AssetsSolution,
) -> BTreeMap<String, WorstMean> {
    let mean = |rows: &[Vec<f64>], asset: usize| rows.iter().map(|row| row[asset]).sum::<f64>() / rows.len() as f64;
    let of = |(asset, (name, moved)): (usize, (&String, &f64))| {
        let (seen, believed) = (mean(seen, asset), mean(centre, asset));
        let worst = WorstMean { seen, believed: (believed != seen).then_some(believed), worst: believed + moved };
        (name.clone(), worst)
    };
    names.iter().zip(&solution.mean_moves).enumerate().map(of).collect()
}
