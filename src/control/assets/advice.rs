//! The advice of one robust step with several assets, by their names.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::AssetsSolution;
use crate::control::policy::caution::Caution;
use crate::control::policy::levels::LevelsAdvised;

/// What to hold of several assets through the coming period.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsAdvice {
    /// Share of wealth in each asset; the rest is in the bank.
    pub allocation: BTreeMap<String, f64>,
    /// The allocation less the holdings: shares of wealth to buy, or where they are negative to sell.
    pub trade: BTreeMap<String, f64>,
    /// Share of each asset in what is held; where next to nothing is, that of inverse volatilities.
    pub composition: BTreeMap<String, f64>,
    /// Share of wealth in all assets together.
    pub total: f64,
    /// The same were no log-return below the lowest seen of any asset: what it is above `total` is the part of the caution that
    /// is for a crash which nobody has seen. Null where `problem.support` rules one out already.
    pub without_crash: Option<f64>,
    /// Wealth for certain that is worth as much as the allocation is against the worst law, less what trading costs: at least this.
    pub certainty_equivalent: f64,
    /// No allocation is worth more than this.
    pub bound: f64,
    /// Wealth of selling everything now and staying in the bank.
    pub floor: f64,
    /// Radius of the ball, in log-return.
    pub radius: f64,
    /// Factor by which the radius of the fund of inverse volatilities is widened to hold for all funds at once. It errs low: by little
    /// where assets move together, by more than a tenth for a dozen that are independent.
    pub radius_factor: f64,
    /// The levels of caution, where one of them is followed: found for the fund of inverse volatilities.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<LevelsAdvised>,
    /// Number of dates seen.
    pub sample_size: usize,
    /// What the law behind `bound` makes of each asset, which is the worst law where the two sides meet.
    pub worst_means: BTreeMap<String, WorstMean>,
    /// What to know before the advice is followed.
    pub caution: Vec<Caution>,
}

/// The one-step problem of several assets, by their names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OneStep {
    /// Shares of wealth that are best for who looks one period ahead.
    pub allocation: BTreeMap<String, f64>,
    /// Wealth for certain after the period that they are worth against the worst law: at least this.
    pub certainty_equivalent: f64,
    /// No allocation is worth more than this.
    pub bound: f64,
    /// What the worst law makes of each asset.
    pub worst_means: BTreeMap<String, WorstMean>,
    /// What to know before the allocation is followed; left out where there is nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub caution: Vec<Caution>,
}

/// The mean of an asset's log-return.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstMean {
    /// Of those seen.
    pub seen: f64,
    /// Under the worst law.
    pub worst: f64,
}

/// By the names of the assets.
pub fn named(names: &[String], values: &[f64]) -> BTreeMap<String, f64> {
    names.iter().cloned().zip(values.iter().copied()).collect()
}

/// What the law behind the bound of a solution makes of each asset.
pub fn worst_means(names: &[String], rows: &[Vec<f64>], solution: &AssetsSolution) -> BTreeMap<String, WorstMean> {
    let of = |(asset, (name, moved)): (usize, (&String, &f64))| {
        let seen = rows.iter().map(|row| row[asset]).sum::<f64>() / rows.len() as f64;
        (name.clone(), WorstMean { seen, worst: seen + moved })
    };
    names.iter().zip(&solution.mean_moves).enumerate().map(of).collect()
}
