//! The report of several assets walked through, as it is written; `docs/backtest.md` says what its figures are.

use std::collections::BTreeMap;

use serde::Serialize;

use super::AssetsChoices;
use crate::control::evaluation::backtest_report::{BacktestIntervals, BootstrapEstimate};

/// Name and version of the report's form.
pub const FORMAT: &str = "ballast-backtest-assets-1";

/// Strategies that lived through a record of several assets. The same record and choices give the same report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AssetsBacktestReport {
    /// `ballast-backtest-assets-1`.
    pub format: String,
    /// Names, in the order of the columns.
    pub assets: Vec<String>,
    /// `daily`, `weekly`, `monthly`, `quarterly` or `yearly`.
    pub frequency: String,
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Of the periods decided about.
    pub dates: Vec<String>,
    /// Whole years decided about, whose utility is taken.
    pub whole_years: usize,
    /// As completed.
    pub choices: AssetsChoices,
    /// How the intervals were made.
    pub intervals: BacktestIntervals,
    /// One strategy in figures each.
    pub strategies: Vec<AssetsFigures>,
    /// What each strategy did, in their order.
    pub periods: Vec<AssetsPeriods>,
    /// What the figures say, the most important first.
    pub sentences: Vec<String>,
}

/// One strategy in figures; returns as fractions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AssetsFigures {
    /// Its name.
    pub strategy: String,
    /// Of mean utility over the whole years, each from wealth 100.
    pub yearly_certainty_equivalent: BootstrapEstimate,
    /// Its own less that of equal shares in all assets; null of those.
    pub beyond_equal: Option<BootstrapEstimate>,
    /// Its own less that of equal shares at its own average total, which nobody could have chosen beforehand; null of equal shares.
    pub beyond_own_mix: Option<BootstrapEstimate>,
    /// Of simple returns.
    pub annual_mean: BootstrapEstimate,
    /// Standard deviation of simple returns.
    pub annual_volatility: BootstrapEstimate,
    /// Mean excess over the bank by its deviation.
    pub sharpe_ratio: BootstrapEstimate,
    /// Share of wealth that is bought and sold in a year.
    pub annual_turnover: BootstrapEstimate,
    /// Largest fall below the highest wealth so far, as a share of it.
    pub max_drawdown: f64,
    /// From 100.
    pub final_wealth: f64,
    /// Share of wealth in all assets together.
    pub mean_allocation: f64,
    /// `(sum a)^2 / sum a^2`, the mean over the periods in which anything is held; null where nothing ever is.
    pub effective_assets: Option<f64>,
    /// Share of wealth in each asset, by its name.
    pub mean_allocations: BTreeMap<String, f64>,
}

/// What one strategy did, a number a period.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AssetsPeriods {
    /// Its name.
    pub strategy: String,
    /// Share of wealth held in each asset, by its name.
    pub allocations: BTreeMap<String, Vec<f64>>,
    /// Of the ball, in log-return; 0 where there was none.
    pub radius: Vec<f64>,
    /// Share of wealth that was bought and sold at the start.
    pub traded: Vec<f64>,
    /// At the end, from 100.
    pub wealth: Vec<f64>,
}
