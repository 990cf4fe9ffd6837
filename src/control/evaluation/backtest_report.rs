//! The report of a walk-forward, as it is sent; `docs/backtest.md` explains its figures.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::evaluation::names::StrategyKind;
use crate::control::request::caution::CautionLevel;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::support::Support;

/// Name and version of the report format.
pub const FORMAT: &str = "ballast-backtest-1";

/// Strategies compared over a record of returns. The same request gives the same report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestReport {
    /// `ballast-backtest-1`.
    pub format: String,
    /// `daily`, `weekly`, `monthly`, `quarterly` or `yearly`; null if the periods have no dates.
    pub frequency: Option<String>,
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Dates of the periods that were decided, those after the first window; null if the periods have none.
    pub dates: Option<Vec<String>>,
    /// Whole years that were decided, over which mean utility is taken; the last ends with the last period.
    pub whole_years: usize,
    /// Number of periods before the first whole year, fewer than a year; they count in no year.
    pub uncounted_periods: usize,
    /// The completed choices.
    pub choices: BacktestChoices,
    /// How the intervals were made.
    pub intervals: BacktestIntervals,
    /// The figures of each strategy.
    pub strategies: Vec<BacktestFigures>,
    /// The decisions and results of each strategy, in the same order.
    pub periods: Vec<BacktestPeriods>,
    /// The findings in sentences, the most important first.
    pub sentences: Vec<String>,
}

/// The choices of a walk-forward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestChoices {
    /// Periods of history that each policy was trained on.
    pub window: usize,
    /// Periods from one training to the next.
    pub every: usize,
    /// Periods that a policy looked ahead.
    pub horizon: usize,
    /// Miscoverage levels of the adaptive strategies.
    pub alpha: Vec<f64>,
    /// Multiple of the radius of every ball.
    pub scale: f64,
    /// Share of every radius that was used.
    pub caution: CautionLevel,
    /// The log-returns that the adversary could use.
    pub support: Support,
    /// Centre of the balls.
    pub centre: CentreSpecification,
    /// Relative risk aversion.
    pub risk_aversion: f64,
    /// Share of each trade that is lost.
    pub trading_cost: f64,
    /// True if every policy was trained as if trading were free.
    pub cost_blind: bool,
    /// Design points per step.
    pub count: usize,
    /// Seed of every training, and of the resamples.
    pub seed: u64,
}

/// How the intervals were made: for certainty equivalents from each year's contribution to them, for chances from whole
/// years, for other figures from circular blocks of the periods, the same for all strategies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestIntervals {
    /// Intended coverage probability of an interval; intervals of differences hold simultaneously with it.
    pub confidence: f64,
    /// Differences from one strategy, whose intervals hold simultaneously. Differences from own mixes number as many as
    /// there are strategies with one.
    pub comparisons: usize,
    /// Number of resamples, for figures that are resampled.
    pub resamples: usize,
    /// Periods per block in these resamples.
    pub period_block: usize,
    /// Consecutive years that may depend on each other.
    pub year_block: usize,
}

/// A figure with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BootstrapEstimate {
    /// Value on the actual record.
    pub value: f64,
    /// Lower and upper end.
    #[schema(value_type = [f64; 2])]
    pub interval: [f64; 2],
}

/// The worth of a strategy and its variation; returns are fractions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Performance {
    /// Certainty equivalent of mean utility over the whole years, each from wealth 100.
    pub yearly_certainty_equivalent: BootstrapEstimate,
    /// Its certainty equivalent less that of the mix of its own average, which nobody could have chosen beforehand: the
    /// gain from changing the allocation. Null for strategies that are such a mix.
    pub beyond_own_mix: Option<BootstrapEstimate>,
    /// Mean simple return per year, compounded: `(1 + m)^p - 1`, m the mean per period and p the periods per year.
    pub annual_mean: BootstrapEstimate,
    /// Standard deviation of simple returns, per square root of a year.
    pub annual_volatility: BootstrapEstimate,
    /// Mean excess over the bank divided by its deviation.
    pub sharpe_ratio: BootstrapEstimate,
    /// Share of wealth that is bought and sold per year.
    pub annual_turnover: BootstrapEstimate,
    /// Share of years that end with a loss, among the years that begin with every period.
    pub chance_of_loss: BootstrapEstimate,
    /// Mean return of the worst twentieth of these years.
    pub worst_twentieth: BootstrapEstimate,
    /// Largest fall below the highest wealth so far, as a share of it.
    pub max_drawdown: f64,
    /// Terminal wealth, from 100.
    pub final_wealth: f64,
    /// Mean share of wealth in the risky asset, or in all assets together.
    pub mean_allocation: f64,
}

/// The figures of one strategy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestFigures {
    /// Name of the strategy.
    pub strategy: String,
    /// Kind of the strategy.
    pub kind: StrategyKind,
    /// True if it was chosen with knowledge of the whole record.
    pub hindsight: bool,
    /// Its rank by `yearly_certainty_equivalent`, 1 for the best; equal ones share it. Null in hindsight.
    pub place: Option<usize>,
    /// Figures that every strategy has; its own mix is a constant mix.
    #[serde(flatten)]
    pub performance: Performance,
    /// The certainty equivalent of the main adaptive strategy less that of this one.
    pub adaptive_ahead: BootstrapEstimate,
    /// Share of the periods with nothing in the risky asset.
    pub all_bank_share: f64,
}

/// The decisions and results of one strategy, one number per period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestPeriods {
    /// Name of the strategy.
    pub strategy: String,
    /// Share of wealth held in the period.
    pub allocation: Vec<f64>,
    /// Lower end of the no-trade region.
    pub low: Vec<f64>,
    /// Upper end of the no-trade region.
    pub high: Vec<f64>,
    /// Radius of the ball, in log-return; 0 if there was none.
    pub radius: Vec<f64>,
    /// Share of wealth moved between bank and asset at the start of the period.
    pub traded: Vec<f64>,
    /// Wealth at the end of the period, from 100.
    pub wealth: Vec<f64>,
}
