//! The report of a walk-forward of several assets, as it is serialised; `docs/backtest.md` explains its figures.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::evaluation::backtest_report::{BacktestIntervals, BootstrapEstimate, Performance};
use crate::control::evaluation::names::StrategyKind;
use crate::control::request::backtest_assets::StrategyFamily;
use crate::control::request::limits::WeightLimits;
use crate::control::request::means::MeansRule;
use crate::control::request::support::Support;

/// Name and version of the report format.
pub const FORMAT: &str = "ballast-backtest-assets-1";

/// Strategies compared over a record of several assets. The same record and choices give the same report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsBacktestReport {
    /// `ballast-backtest-assets-1`.
    pub format: String,
    /// Names of the assets, in the order of the columns.
    pub assets: Vec<String>,
    /// `daily`, `weekly`, `monthly`, `quarterly` or `yearly`.
    pub frequency: String,
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Dates of the periods that were decided.
    pub dates: Vec<String>,
    /// Whole years that were decided, over which mean utility is taken; the last ends with the last period.
    pub whole_years: usize,
    /// Number of periods before the first whole year, fewer than a year; they count in no year.
    pub uncounted_periods: usize,
    /// The completed choices.
    pub choices: AssetsChoices,
    /// How the intervals were made.
    pub intervals: BacktestIntervals,
    /// The figures of each strategy.
    pub strategies: Vec<AssetsFigures>,
    /// The decisions and results of each strategy, in the same order.
    pub periods: Vec<AssetsPeriods>,
    /// The findings in sentences, the most important first.
    pub sentences: Vec<String>,
}

/// The choices of a walk-forward of several assets.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsChoices {
    /// The strategies that are compared with the rules that people use.
    pub strategies: Vec<StrategyFamily>,
    /// Numbers of past periods that strategies know; null means all since the first.
    pub windows: Vec<Option<usize>>,
    /// Periods from one training of the policy, one measurement of the radius, and one choice of the static strategy, to
    /// the next.
    pub every: usize,
    /// Periods that a policy looks ahead; null if none is trained.
    pub horizon: Option<usize>,
    /// Design points per step of a policy; null if none is trained.
    pub count: Option<usize>,
    /// Miscoverage of the radius.
    pub alpha: f64,
    /// The log-returns of each asset that the adversary may use.
    pub support: Support,
    /// The means that policies and the one-step problem give the assets.
    pub means: MeansRule,
    /// Relative risk aversion.
    pub risk_aversion: f64,
    /// Share of each trade that is lost.
    pub trading_cost: f64,
    /// Limits on the composition of every strategy but the user's own; left out if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<WeightLimits>,
    /// Seed of the bridges and of the resamples.
    pub seed: u64,
}

/// The figures of one strategy.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsFigures {
    /// Name of the strategy.
    pub strategy: String,
    /// Kind of the strategy.
    pub kind: StrategyKind,
    /// Its rank by `yearly_certainty_equivalent`, 1 for the best; equal ones share it.
    pub place: usize,
    /// Figures that every strategy has. Its own mix is equal shares at its own average total, and an allocation is the
    /// share in all assets together.
    #[serde(flatten)]
    pub performance: Performance,
    /// Its certainty equivalent less that of equal shares in all assets; null for equal shares.
    pub beyond_equal: Option<BootstrapEstimate>,
    /// `(sum a)^2 / sum a^2`, averaged over the periods in which anything is held; null if nothing ever is.
    pub effective_assets: Option<f64>,
    /// Share of wealth in each asset, by its name.
    pub mean_allocations: BTreeMap<String, f64>,
}

/// The decisions and results of one strategy, one number per period.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsPeriods {
    /// Name of the strategy.
    pub strategy: String,
    /// Share of wealth held in each asset, by its name.
    pub allocations: BTreeMap<String, Vec<f64>>,
    /// Radius of the ball, in log-return; 0 if there was none.
    pub radius: Vec<f64>,
    /// Share of wealth that was bought and sold at the start of the period.
    pub traded: Vec<f64>,
    /// Wealth at the end of the period, from 100.
    pub wealth: Vec<f64>,
}
