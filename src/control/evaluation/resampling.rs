//! What was lived, in figures, and the same of resamples of it: alike for all strategies, so that differences are of the same
//! worlds.

use crate::control::evaluation::account::{Account, Annual, yearly_certainty_equivalent};
use crate::control::evaluation::backtest_report::{BacktestIntervals, BootstrapEstimate, Performance};
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

/// What figures of a year are made with.
pub struct Scale {
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Of a year's wealth.
    pub utility: UtilitySpecification,
    /// Of the resamples.
    pub seed: u64,
}

/// The series of one strategy that are resampled.
pub struct Series<'a> {
    returns: Vec<f64>,
    traded: &'a [f64],
    growth: Vec<f64>,
    /// Of the constant mix of its own average, unless it is one.
    growth_of_own_mix: Option<Vec<f64>>,
}

/// What one resample of the periods and years gives for one strategy.
pub struct Measured {
    /// Mean, volatility and Sharpe ratio.
    pub annual: Annual,
    /// Share of wealth that is traded in a year.
    pub turnover: f64,
    /// Of mean utility over the whole years, each from [`INITIAL_WEALTH`].
    pub certainty_equivalent: f64,
    /// That of the constant mix of its own average; the same where it is one.
    pub of_own_mix: f64,
}

/// All strategies over what was lived and over every resample of it.
pub struct Resampled {
    whole: Vec<Measured>,
    resampled: Vec<Vec<Measured>>,
}

/// How the intervals are made.
pub fn intervals(periods_per_year: usize) -> BacktestIntervals {
    BacktestIntervals {
        confidence: CONFIDENCE,
        resamples: RESAMPLES,
        period_block: periods_per_year,
        year_block: YEAR_BLOCK,
    }
}

impl<'a> Series<'a> {
    /// Of the books of a strategy, and of those of the mix that it is measured against.
    pub fn of(account: &'a Account, own_mix: Option<&Account>, periods_per_year: usize) -> Self {
        Series {
            returns: account.returns(),
            traded: &account.traded,
            growth: account.yearly_growth(periods_per_year),
            growth_of_own_mix: own_mix.map(|mix| mix.yearly_growth(periods_per_year)),
        }
    }

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

impl Resampled {
    /// Resamples periods and years; `bank` is what the bank paid in each period.
    pub fn of(series: &[Series], bank: &[f64], scale: &Scale) -> Self {
        let years = bank.len() / scale.periods_per_year;
        let measure = |periods: &[usize], years: &[usize]| -> Vec<Measured> {
            series.iter().map(|series| series.measure(bank, periods, years, scale)).collect()
        };
        let whole = measure(&(0..bank.len()).collect::<Vec<_>>(), &(0..years).collect::<Vec<_>>());
        let resample = |draw| {
            let blocks =
                |purpose, length, block| circular_blocks(length, block, &mut stream(scale.seed, purpose, 0, draw));
            measure(
                &blocks("bootstrap months", bank.len(), scale.periods_per_year),
                &blocks("bootstrap years", years, YEAR_BLOCK),
            )
        };
        Resampled { whole, resampled: (0..RESAMPLES).map(resample).collect() }
    }

    /// What the strategy of this number was worth and how it varied, whose books are `account`.
    pub fn performance(&self, index: usize, account: &Account, has_own_mix: bool) -> Performance {
        Performance {
            yearly_certainty_equivalent: self.estimate(|all| all[index].certainty_equivalent),
            beyond_own_mix: has_own_mix
                .then(|| self.estimate(|all| all[index].certainty_equivalent - all[index].of_own_mix)),
            annual_mean: self.estimate(|all| all[index].annual.mean),
            annual_volatility: self.estimate(|all| all[index].annual.volatility),
            sharpe_ratio: self.estimate(|all| all[index].annual.sharpe_ratio),
            annual_turnover: self.estimate(|all| all[index].turnover),
            max_drawdown: account.max_drawdown(),
            final_wealth: account.final_wealth(),
            mean_allocation: account.mean_allocation(),
        }
    }

    /// A figure of what was lived, with its interval.
    pub fn estimate(&self, of: impl Fn(&[Measured]) -> f64) -> BootstrapEstimate {
        let values: Vec<f64> = self.resampled.iter().map(|measured| of(measured)).collect();
        let tail = 0.5 * (1.0 - CONFIDENCE);
        BootstrapEstimate { value: of(&self.whole), interval: [quantile(&values, tail), quantile(&values, 1.0 - tail)] }
    }
}
