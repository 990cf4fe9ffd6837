//! The books in figures, each with an interval where a resample of the periods has a meaning.

use crate::control::evaluation::account::{Account, Annual, keep, yearly_certainty_equivalent};
use crate::control::evaluation::backtest_report::{BacktestFigures, BootstrapEstimate};
use crate::control::evaluation::rolling::{Decision, Period};
use crate::control::problem::actions::Band;
use crate::control::request::specification::UtilitySpecification;
use crate::numerics::block_bootstrap::circular_blocks;
use crate::numerics::streams::stream;
use crate::numerics::summary::quantile;

/// Wealth at the start of the whole, and of every year whose utility is taken.
pub const INITIAL_WEALTH: f64 = 100.0;
/// Resamples; a block of periods is a year of them.
pub const RESAMPLES: usize = 2000;
/// Years of a block, where years are resampled.
pub const YEAR_BLOCK: usize = 3;
/// Probability that an interval is meant to hold.
pub const CONFIDENCE: f64 = 0.9;

/// One strategy: what it held, and what became of it.
pub struct Line {
    /// Its name.
    pub name: String,
    /// One a period.
    pub decisions: Vec<Decision>,
    /// Its books.
    pub account: Account,
    /// Chosen with what only the end could tell.
    pub hindsight: bool,
}

/// All strategies in figures.
pub struct Analysis {
    /// In the order of the strategies.
    pub figures: Vec<BacktestFigures>,
    /// Whole years, whose utility is taken.
    pub years: usize,
}

impl Line {
    /// The books of what was decided; `cost` is charged on what is traded.
    pub fn new(name: String, decisions: Vec<Decision>, periods: &[Period], cost: f64) -> Self {
        let account = keep(decisions.iter().map(|decision| decision.band), periods, cost, INITIAL_WEALTH);
        Line { name, decisions, account, hindsight: false }
    }

    /// The constant mix that holds on average what this line held: what its timing is measured against.
    pub fn hindsight(&self, periods: &[Period], cost: f64) -> Line {
        let share = self.mean_allocation();
        let decision = Decision { band: Band::of(&[share]), radius: 0.0, source: None };
        let name = format!("constant {:.1} %", 100.0 * share);
        Line { hindsight: true, ..Line::new(name, vec![decision; periods.len()], periods, cost) }
    }

    /// Whether it holds one share throughout: such a line times nothing.
    fn is_constant(&self) -> bool {
        let first = self.decisions.first().map(|decision| decision.band);
        self.decisions.iter().all(|decision| Some(decision.band) == first && decision.band.low == decision.band.high)
    }

    fn mean_allocation(&self) -> f64 {
        self.account.allocations.iter().sum::<f64>() / self.account.allocations.len() as f64
    }
}

/// What figures of a year are made with.
pub struct Scale {
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Of a year's wealth.
    pub utility: UtilitySpecification,
    /// Lost of what is traded, as a share of it.
    pub trading_cost: f64,
    /// Of the resamples.
    pub seed: u64,
}

/// What one resample of the periods and years gives for one strategy.
struct Measured {
    annual: Annual,
    turnover: f64,
    certainty_equivalent: f64,
    /// That of the constant mix of its own average; the same where it is one.
    of_own_mix: f64,
}

/// The series of one strategy that are resampled.
struct Series<'a> {
    returns: Vec<f64>,
    traded: &'a [f64],
    growth: Vec<f64>,
    /// Of the constant mix of its own average, unless it is one.
    growth_of_own_mix: Option<Vec<f64>>,
}

impl Series<'_> {
    fn measure(&self, bank: &[f64], periods: &[usize], years: &[usize], scale: &Scale) -> Measured {
        let pick =
            |values: &[f64], indices: &[usize]| -> Vec<f64> { indices.iter().map(|&index| values[index]).collect() };
        let per_year = scale.periods_per_year as f64;
        let traded: f64 = periods.iter().map(|&period| self.traded[period]).sum();
        let worth = |growth: &[f64]| yearly_certainty_equivalent(scale.utility, &pick(growth, years), INITIAL_WEALTH);
        let certainty_equivalent = worth(&self.growth);
        Measured {
            annual: Annual::of(&pick(&self.returns, periods), &pick(bank, periods), per_year),
            turnover: per_year * traded / periods.len() as f64,
            certainty_equivalent,
            of_own_mix: self.growth_of_own_mix.as_deref().map_or(certainty_equivalent, worth),
        }
    }
}

impl Analysis {
    /// Resamples periods and years alike for all strategies, so that differences are of the same worlds.
    /// Others are compared with line `main`.
    pub fn of(lines: &[Line], main: usize, periods: &[Period], scale: &Scale) -> Self {
        let bank: Vec<f64> = periods.iter().map(|period| period.bank_return).collect();
        let series: Vec<Series> = lines
            .iter()
            .map(|line| Series {
                returns: line.account.returns(),
                traded: &line.account.traded,
                growth: line.account.yearly_growth(scale.periods_per_year),
                growth_of_own_mix: (!line.is_constant())
                    .then(|| line.hindsight(periods, scale.trading_cost).account.yearly_growth(scale.periods_per_year)),
            })
            .collect();
        let years = periods.len() / scale.periods_per_year;
        let measure = |periods: &[usize], years: &[usize]| -> Vec<Measured> {
            series.iter().map(|series| series.measure(&bank, periods, years, scale)).collect()
        };
        let whole = measure(&(0..periods.len()).collect::<Vec<_>>(), &(0..years).collect::<Vec<_>>());
        let resampled: Vec<Vec<Measured>> = (0..RESAMPLES)
            .map(|draw| {
                let blocks =
                    |purpose, length, block| circular_blocks(length, block, &mut stream(scale.seed, purpose, 0, draw));
                measure(
                    &blocks("bootstrap months", periods.len(), scale.periods_per_year),
                    &blocks("bootstrap years", years, YEAR_BLOCK),
                )
            })
            .collect();
        let figures = lines.iter().enumerate().map(|(index, line)| {
            let estimate = |of: &dyn Fn(&[Measured]) -> f64| {
                let values: Vec<f64> = resampled.iter().map(|measured| of(measured)).collect();
                let tail = 0.5 * (1.0 - CONFIDENCE);
                BootstrapEstimate {
                    value: of(&whole),
                    interval: [quantile(&values, tail), quantile(&values, 1.0 - tail)],
                }
            };
            let zero = line.account.allocations.iter().filter(|allocation| **allocation <= 0.0).count();
            BacktestFigures {
                strategy: line.name.clone(),
                hindsight: line.hindsight,
                yearly_certainty_equivalent: estimate(&|all| all[index].certainty_equivalent),
                adaptive_ahead: estimate(&|all| all[main].certainty_equivalent - all[index].certainty_equivalent),
                beyond_own_mix: series[index]
                    .growth_of_own_mix
                    .is_some()
                    .then(|| estimate(&|all| all[index].certainty_equivalent - all[index].of_own_mix)),
                annual_mean: estimate(&|all| all[index].annual.mean),
                annual_volatility: estimate(&|all| all[index].annual.volatility),
                sharpe_ratio: estimate(&|all| all[index].annual.sharpe_ratio),
                annual_turnover: estimate(&|all| all[index].turnover),
                max_drawdown: line.account.drawdowns().into_iter().fold(0.0, f64::max),
                final_wealth: line.account.wealth.last().copied().unwrap_or(INITIAL_WEALTH),
                mean_allocation: line.mean_allocation(),
                all_bank_share: zero as f64 / line.decisions.len() as f64,
            }
        });
        Analysis { figures: figures.collect(), years }
    }
}
