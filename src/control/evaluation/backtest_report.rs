//! The report of a walk-forward, as it travels; `docs/backtest.md` says what its figures are.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::evaluation::names::StrategyKind;
use crate::control::request::caution::CautionLevel;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::support::Support;

/// Name and version of the report's form.
pub const FORMAT: &str = "ballast-backtest-1";

/// Strategies that lived through a record of returns. The same request gives the same report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestReport {
    /// `ballast-backtest-1`.
    pub format: String,
    /// `daily`, `weekly`, `monthly`, `quarterly` or `yearly`; null where the periods have no dates.
    pub frequency: Option<String>,
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Of the periods decided about, those after the first window; null where the periods have none.
    pub dates: Option<Vec<String>>,
    /// Whole years decided about, whose utility is taken; the last ends with the last period.
    pub whole_years: usize,
    /// The first periods decided about, fewer than a year, which count in none of them.
    pub uncounted_periods: usize,
    /// As completed.
    pub choices: BacktestChoices,
    /// How the intervals were made.
    pub intervals: BacktestIntervals,
    /// One strategy in figures each.
    pub strategies: Vec<BacktestFigures>,
    /// What each strategy did, in their order.
    pub periods: Vec<BacktestPeriods>,
    /// What the figures say, the most important first.
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
    /// Levels of the adaptive strategies.
    pub alpha: Vec<f64>,
    /// Multiple of the radius of every ball.
    pub scale: f64,
    /// Share of every radius that was acted on.
    pub caution: CautionLevel,
    /// What the adversary could use.
    pub support: Support,
    /// What the balls are centred on.
    pub centre: CentreSpecification,
    /// Relative.
    pub risk_aversion: f64,
    /// Lost of what is traded, as a share of it.
    pub trading_cost: f64,
    /// Whether every policy was trained as if trading were free.
    pub cost_blind: bool,
    /// Design points per step.
    pub count: usize,
    /// Of every training, and of the resamples.
    pub seed: u64,
}

/// How the intervals were made: of certainty equivalents from what each year adds to them, of chances from whole years, of other figures
/// by circular blocks of what was lived, the same for all strategies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestIntervals {
    /// Probability that an interval is meant to hold; those of differences all hold at once with it.
    pub confidence: f64,
    /// Differences from one strategy, whose intervals hold at once; those from own mixes are as many as have one.
    pub comparisons: usize,
    /// How many, where figures are resampled.
    pub resamples: usize,
    /// Periods of a block of them.
    pub period_block: usize,
    /// Neighbouring years that may depend on each other.
    pub year_block: usize,
}

/// A figure with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BootstrapEstimate {
    /// Of what was lived.
    pub value: f64,
    /// Its ends.
    #[schema(value_type = [f64; 2])]
    pub interval: [f64; 2],
}

/// What a strategy was worth and how it varied; returns as fractions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Performance {
    /// Of mean utility over the whole years, each from wealth 100.
    pub yearly_certainty_equivalent: BootstrapEstimate,
    /// Its own less that of the mix of its own average, which nobody could have chosen beforehand: what changing the allocation
    /// earned. Null of strategies that are such a mix.
    pub beyond_own_mix: Option<BootstrapEstimate>,
    /// Mean simple return of a year, compounded: `(1 + m)^p - 1`, m the mean of a period and p the periods of a year.
    pub annual_mean: BootstrapEstimate,
    /// Standard deviation of simple returns.
    pub annual_volatility: BootstrapEstimate,
    /// Mean excess over the bank by its deviation.
    pub sharpe_ratio: BootstrapEstimate,
    /// Share of wealth that is bought and sold in a year.
    pub annual_turnover: BootstrapEstimate,
    /// Share of the years, one beginning with every period, that end with less than they began with.
    pub chance_of_loss: BootstrapEstimate,
    /// Mean return of the worst twentieth of these years.
    pub worst_twentieth: BootstrapEstimate,
    /// Largest fall below the highest wealth so far, as a share of it.
    pub max_drawdown: f64,
    /// From 100.
    pub final_wealth: f64,
    /// Share of wealth at risk.
    pub mean_allocation: f64,
}

/// One strategy in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestFigures {
    /// Its name.
    pub strategy: String,
    /// Its kind.
    pub kind: StrategyKind,
    /// Whether it was chosen with what only the end could tell.
    pub hindsight: bool,
    /// Its place by `yearly_certainty_equivalent`, 1 the best; equal ones share it. Null in hindsight.
    pub place: Option<usize>,
    /// As of every strategy; its own mix is a constant one.
    #[serde(flatten)]
    pub performance: Performance,
    /// The certainty equivalent of the main adaptive strategy less that of this one.
    pub adaptive_ahead: BootstrapEstimate,
    /// Share of the periods with nothing in the risky asset.
    pub all_bank_share: f64,
}

/// What one strategy did, a number a period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BacktestPeriods {
    /// Its name.
    pub strategy: String,
    /// Share of wealth held through the period.
    pub allocation: Vec<f64>,
    /// Lower end of the holdings that were kept as they were.
    pub low: Vec<f64>,
    /// Upper end of them.
    pub high: Vec<f64>,
    /// Of the ball, in log-return; 0 where there was none.
    pub radius: Vec<f64>,
    /// Share of wealth that changed between bank and asset at the start.
    pub traded: Vec<f64>,
    /// At the end, from 100.
    pub wealth: Vec<f64>,
}
