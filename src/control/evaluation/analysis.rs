//! The books in figures, each with an interval where a resample of the periods has a meaning.

use crate::control::evaluation::account::{Account, keep};
use crate::control::evaluation::backtest_report::BacktestFigures;
use crate::control::evaluation::resampling::{INITIAL_WEALTH, Resampled, Scale, Series};
use crate::control::evaluation::rolling::{Decision, Period};
use crate::control::problem::actions::Band;

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
        let share = self.account.mean_allocation();
        let decision = Decision { band: Band::of(&[share]), radius: 0.0, source: None };
        let name = format!("constant {:.1} %", 100.0 * share);
        Line { hindsight: true, ..Line::new(name, vec![decision; periods.len()], periods, cost) }
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
        let own_mix = |line: &Line| (!line.is_constant()).then(|| line.hindsight(periods, cost).account);
        let mixes: Vec<Option<Account>> = lines.iter().map(own_mix).collect();
        let series: Vec<Series> = lines
            .iter()
            .zip(&mixes)
            .map(|(line, mix)| Series::of(&line.account, mix.as_ref(), scale.periods_per_year))
            .collect();
        let resampled = Resampled::of(&series, &bank, scale);
        let figures = lines.iter().zip(&mixes).enumerate().map(|(index, (line, mix))| {
            let zero = line.account.allocations.iter().filter(|allocation| **allocation <= 0.0).count();
            BacktestFigures {
                strategy: line.name.clone(),
                hindsight: line.hindsight,
                performance: resampled.performance(index, &line.account, mix.is_some()),
                adaptive_ahead: resampled
                    .estimate(|all| all[main].certainty_equivalent - all[index].certainty_equivalent),
                all_bank_share: zero as f64 / line.decisions.len() as f64,
            }
        });
        Analysis { figures: figures.collect(), years: periods.len() / scale.periods_per_year }
    }
}
