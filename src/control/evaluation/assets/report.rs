//! The report of several assets walked through, as it is written; `docs/backtest.md` says what its figures are.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::evaluation::backtest_report::{BacktestIntervals, BootstrapEstimate, Performance};
use crate::control::evaluation::names::StrategyKind;
use crate::control::request::support::Support;

/// Name and version of the report's form.
pub const FORMAT: &str = "ballast-backtest-assets-1";

/// Strategies that lived through a record of several assets. The same record and choices give the same report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
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
    /// Whole years decided about, whose utility is taken; the last ends with the last period.
    pub whole_years: usize,
    /// The first periods decided about, fewer than a year, which count in none of them.
    pub uncounted_periods: usize,
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

/// How a record of several assets is walked through.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsChoices {
    /// Periods that strategies know; null is all since the first.
    pub windows: Vec<Option<usize>>,
    /// Periods from one measuring of the radius, and one choice of the static strategy, to the next.
    pub every: usize,
    /// Miscoverage of the radius.
    pub alpha: f64,
    /// The log-returns of each asset that the adversary may use.
    pub support: Support,
    /// Relative.
    pub risk_aversion: f64,
    /// Lost of what is traded, as a share of it.
    pub trading_cost: f64,
    /// Of the bridges and of the resamples.
    pub seed: u64,
}

/// One strategy in figures.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsFigures {
    /// Its name.
    pub strategy: String,
    /// Its kind.
    pub kind: StrategyKind,
    /// Its place by `yearly_certainty_equivalent`, 1 the best; equal ones share it.
    pub place: usize,
    /// As of every strategy; its own mix is equal shares at its own average total, and an allocation that in all assets together.
    #[serde(flatten)]
    pub performance: Performance,
    /// Its certainty equivalent less that of equal shares in all assets; null of those.
    pub beyond_equal: Option<BootstrapEstimate>,
    /// `(sum a)^2 / sum a^2`, the mean over the periods in which anything is held; null where nothing ever is.
    pub effective_assets: Option<f64>,
    /// Share of wealth in each asset, by its name.
    pub mean_allocations: BTreeMap<String, f64>,
}

/// What one strategy did, a number a period.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
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
