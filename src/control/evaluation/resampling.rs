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
/// Share of the years that are the worst.
const WORST: f64 = 0.05;
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
    /// Returns of the years that begin with every period, ascending, each with the period.
    years: Vec<(f64, usize)>,
    /// Of the constant mix of its own average, unless it is one.
    growth_of_own_mix: Option<Vec<f64>>,
}

/// What one resample of the periods and years gives for one strategy.
pub struct Measured {
    /// Mean, volatility and Sharpe ratio.
    pub annual: Annual,
    /// Share of wealth that is traded in a year.
    pub turnover: f64,
    /// Share of the years, one from every period on, that end with less than they began with.
    pub chance_of_loss: f64,
    /// Mean return of the worst twentieth of them.
    pub worst_twentieth: f64,
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
        let rolling = account.rolling_growth(periods_per_year).enumerate();
        let mut years: Vec<(f64, usize)> = rolling.map(|(start, growth)| (growth - 1.0, start)).collect();
        years.sort_by(|one, other| one.0.total_cmp(&other.0));
        Series {
            years,
            returns: account.returns(),
            traded: &account.traded,
            growth: account.yearly_growth(periods_per_year),
            growth_of_own_mix: own_mix.map(|mix| mix.yearly_growth(periods_per_year)),
        }
    }

    fn measure(&self, bank: &[f64], drawn: &Drawn, scale: &Scale) -> Measured {
        let Drawn { periods, years, rolling } = drawn;
        let pick =
            |values: &[f64], indices: &[usize]| -> Vec<f64> { indices.iter().map(|&index| values[index]).collect() };
        let per_year = scale.periods_per_year as f64;
        let traded: f64 = periods.iter().map(|&period| self.traded[period]).sum();
        let (lost, worst) = self.losses(rolling);
        let worth = |growth: &[f64]| yearly_certainty_equivalent(scale.utility, &pick(growth, years), INITIAL_WEALTH);
        let certainty_equivalent = worth(&self.growth);
        Measured {
            annual: Annual::of(&pick(&self.returns, periods), &pick(bank, periods), per_year),
            turnover: per_year * traded / periods.len() as f64,
            chance_of_loss: lost,
            worst_twentieth: worst,
            certainty_equivalent,
            of_own_mix: self.growth_of_own_mix.as_deref().map_or(certainty_equivalent, worth),
        }
    }

    /// The share of losses among the years that begin with every period, each counted so often, and the mean of the worst of them; of
    /// the year at the edge as much counts as makes the share whole.
    fn losses(&self, counts: &[f64]) -> (f64, f64) {
        let all: f64 = counts.iter().sum();
        let lost: f64 = self.years.iter().take_while(|year| year.0 < 0.0).map(|year| counts[year.1]).sum();
        let (mut left, mut sum) = (WORST * all, 0.0);
        for &(growth, start) in &self.years {
            let taken = counts[start].min(left);
            (left, sum) = (left - taken, sum + taken * growth);
            if left <= 0.0 {
                break;
            }
        }
        (lost / all, sum / (WORST * all))
    }
}

/// What is counted, and how often.
struct Drawn {
    /// By number.
    periods: Vec<usize>,
    /// Whole ones, by number.
    years: Vec<usize>,
    /// How often each year counts of those that begin with every period.
    rolling: Vec<f64>,
}

impl Drawn {
    /// All that was lived, once.
    fn whole(periods: usize, year: usize) -> Self {
        Drawn {
            periods: (0..periods).collect(),
            years: (0..periods / year).collect(),
            rolling: vec![1.0; periods + 1 - year],
        }
    }

    /// Streams: ("bootstrap months", 0, draw), ("bootstrap years", 0, draw) and ("rolling years", 0, draw).
    fn again(whole: &Drawn, scale: &Scale, draw: usize) -> Self {
        let blocks = |purpose, length, block| circular_blocks(length, block, &mut stream(scale.seed, purpose, 0, draw));
        let year = scale.periods_per_year;
        let mut rolling = vec![0.0; whole.rolling.len()];
        let starts = blocks("rolling years", rolling.len(), YEAR_BLOCK * year);
        starts.into_iter().for_each(|start| rolling[start] += 1.0);
        Drawn {
            periods: blocks("bootstrap months", whole.periods.len(), year),
            years: blocks("bootstrap years", whole.years.len(), YEAR_BLOCK),
            rolling,
        }
    }
}

impl Resampled {
    /// Resamples periods and years; `bank` is what the bank paid in each period.
    pub fn of(series: &[Series], bank: &[f64], scale: &Scale) -> Self {
        let whole = Drawn::whole(bank.len(), scale.periods_per_year);
        let measure = |drawn: &Drawn| -> Vec<Measured> {
            series.iter().map(|series| series.measure(bank, drawn, scale)).collect()
        };
        let resample = |draw| measure(&Drawn::again(&whole, scale, draw));
        Resampled { whole: measure(&whole), resampled: (0..RESAMPLES).map(resample).collect() }
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
            chance_of_loss: self.estimate(|all| all[index].chance_of_loss),
            worst_twentieth: self.estimate(|all| all[index].worst_twentieth),
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
