//! The books in figures, each with an interval where a resample of the periods has a meaning.

use crate::control::evaluation::account::{Account, keep, uncounted_periods};
use crate::control::evaluation::backtest_report::BacktestFigures;
use crate::control::evaluation::names::{StrategyKind, own_mix_name};
use crate::control::evaluation::resampling::{Resampled, Series};
use crate::control::evaluation::rolling::{Decision, Period};
use crate::control::evaluation::yearly_worth::{
    INITIAL_WEALTH, MixBooks, Scale, YearlyWorth, at_once, present_at_once,
};
use crate::control::problem::actions::Band;
use crate::numerics::long_run_mean::LongRunMean;

/// One strategy: what it held, and what became of it.
pub struct Line {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: StrategyKind,
    /// One a period.
    pub decisions: Vec<Decision>,
    /// Its books.
    pub account: Account,
}

/// All strategies in figures.
pub struct Analysis {
    /// In the order of the strategies.
    pub figures: Vec<BacktestFigures>,
    /// Whole years, whose utility is taken; the last ends with the last period.
    pub years: usize,
    /// Periods before the first of these years.
    pub uncounted_periods: usize,
}

impl Line {
    /// The books of what was decided; `cost` is charged on what is traded.
    pub fn new((kind, name): (StrategyKind, String), decisions: Vec<Decision>, periods: &[Period], cost: f64) -> Self {
        let account = keep(decisions.iter().map(|decision| decision.band), periods, cost, INITIAL_WEALTH);
        Line { name, kind, decisions, account }
    }

    /// Tells whether it was chosen with what only the end could tell.
    pub fn is_hindsight(&self) -> bool {
        self.kind == StrategyKind::OwnMix
    }

    /// The constant mix that holds on average what this line held: what its timing is measured against.
    pub fn hindsight(&self, periods: &[Period], cost: f64) -> Line {
        let share = self.account.mean_allocation();
        Line::constant((StrategyKind::OwnMix, own_mix_name(share)), share, periods, cost)
    }

    fn constant(named: (StrategyKind, String), share: f64, periods: &[Period], cost: f64) -> Line {
        let decision = Decision { band: Band::of(&[share]), radius: 0.0, source: None };
        Line::new(named, vec![decision; periods.len()], periods, cost)
    }

    /// Whether it holds one share throughout: such a line times nothing.
    fn is_constant(&self) -> bool {
        let first = self.decisions.first().map(|decision| decision.band);
        self.decisions.iter().all(|decision| Some(decision.band) == first && decision.band.low == decision.band.high)
    }
}

impl Analysis {
    /// Others are compared with line `main`; all trade at `cost`.
    pub fn of(lines: &[Line], main: usize, periods: &[Period], cost: f64, scale: &Scale) -> Self {
        let bank: Vec<f64> = periods.iter().map(|period| period.bank_return).collect();
        let own_mix =
            |share: f64| Line::constant((StrategyKind::OwnMix, own_mix_name(share)), share, periods, cost).account;
        let year = scale.periods_per_year;
        let series: Vec<Series> = lines.iter().map(|line| Series::of(&line.account, year)).collect();
        let resampled = Resampled::of(&series, &bank, scale);
        let worths: Vec<YearlyWorth> =
            lines.iter().map(|line| YearlyWorth::new(scale.utility, &line.account.yearly_growth(year))).collect();
        let ahead: Vec<LongRunMean> = worths.iter().map(|worth| worths[main].beyond(worth)).collect();
        let beyond = |(line, worth): (&Line, &YearlyWorth)| {
            let mix = (!line.is_constant()).then(|| MixBooks::new(line.account.mean_allocation(), own_mix))?;
            Some(worth.beyond_own_mix(&line.account, &mix, scale))
        };
        let beyond = present_at_once(lines.iter().zip(&worths).map(beyond).collect(), scale.seed);
        let competing = || lines.iter().zip(&worths).filter(|(line, _)| !line.is_hindsight()).map(|(_, worth)| worth);
        let figures = lines.iter().enumerate().zip(at_once(&ahead, scale.seed)).zip(beyond);
        let figures = figures.map(|(((index, line), adaptive_ahead), beyond)| {
            let zero = line.account.allocations.iter().filter(|allocation| **allocation <= 0.0).count();
            BacktestFigures {
                strategy: line.name.clone(),
                kind: line.kind,
                hindsight: line.is_hindsight(),
                place: (!line.is_hindsight()).then(|| worths[index].place(competing())),
                performance: resampled.performance(index, &line.account, worths[index].estimate(), beyond),
                adaptive_ahead,
                all_bank_share: zero as f64 / line.decisions.len() as f64,
            }
        });
        Analysis {
            figures: figures.collect(),
            years: periods.len() / scale.periods_per_year,
            uncounted_periods: uncounted_periods(periods.len(), scale.periods_per_year),
        }
    }
}
