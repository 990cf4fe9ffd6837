//! The figures of all strategies, each with an interval if resampling the periods makes sense for it.

use crate::control::evaluation::account::{Account, keep, uncounted_periods};
use crate::control::evaluation::backtest_report::BacktestFigures;
use crate::control::evaluation::names::{StrategyKind, own_mix_name};
use crate::control::evaluation::resampling::{ResampledFigures, StrategySeries};
use crate::control::evaluation::walk_forward::{ActualPeriod, Decision};
use crate::control::evaluation::yearly_worth::{
    INITIAL_WEALTH, MixBooks, Scale, YearlyWorth, at_once, present_at_once,
};
use crate::control::problem::actions::Band;
use crate::numerics::statistics::long_run_mean::LongRunMean;

/// One strategy with its decisions and its account.
pub struct StrategyLine {
    /// Name of the strategy.
    pub name: String,
    /// Kind of the strategy.
    pub kind: StrategyKind,
    /// Its decisions, one per period.
    pub decisions: Vec<Decision>,
    /// Its account.
    pub account: Account,
}

/// The figures of all strategies.
pub struct Analysis {
    /// Figures in the order of the strategies.
    pub figures: Vec<BacktestFigures>,
    /// Number of whole years, over which mean utility is taken; the last ends with the last period.
    pub years: usize,
    /// Number of periods before the first of these years.
    pub uncounted_periods: usize,
}

impl StrategyLine {
    /// Computes the account that follows from the decisions; `cost` is the share of each trade that is lost.
    pub fn new(
        (kind, name): (StrategyKind, String),
        decisions: Vec<Decision>,
        periods: &[ActualPeriod],
        cost: f64,
    ) -> Self {
        let account = keep(decisions.iter().map(|decision| decision.band), periods, cost, INITIAL_WEALTH);
        StrategyLine { name, kind, decisions, account }
    }

    /// Returns true if the strategy was chosen with knowledge of the whole record.
    pub fn is_hindsight(&self) -> bool {
        self.kind == StrategyKind::OwnMix
    }

    /// Returns the constant mix of this line's average share, against which its timing is measured.
    pub fn hindsight(&self, periods: &[ActualPeriod], cost: f64) -> StrategyLine {
        let share = self.account.mean_allocation();
        StrategyLine::constant((StrategyKind::OwnMix, own_mix_name(share)), share, periods, cost)
    }

    fn constant(named: (StrategyKind, String), share: f64, periods: &[ActualPeriod], cost: f64) -> StrategyLine {
        let decision = Decision { band: Band::of(&[share]), radius: 0.0, source: None };
        StrategyLine::new(named, vec![decision; periods.len()], periods, cost)
    }

    /// Returns true if the line holds one share throughout, and so has no timing.
    fn is_constant(&self) -> bool {
        let first = self.decisions.first().map(|decision| decision.band);
        self.decisions.iter().all(|decision| Some(decision.band) == first && decision.band.low == decision.band.high)
    }
}

impl Analysis {
    /// Compares the other lines with line `main`; all trade at `cost`.
    pub fn of(lines: &[StrategyLine], main: usize, periods: &[ActualPeriod], cost: f64, scale: &Scale) -> Self {
        let bank: Vec<f64> = periods.iter().map(|period| period.bank_return).collect();
        let own_mix = |share: f64| {
            StrategyLine::constant((StrategyKind::OwnMix, own_mix_name(share)), share, periods, cost).account
        };
        let year = scale.periods_per_year;
        let series: Vec<StrategySeries> = lines.iter().map(|line| StrategySeries::of(&line.account, year)).collect();
        let resampled = ResampledFigures::of(&series, &bank, scale);
        let worths: Vec<YearlyWorth> =
            lines.iter().map(|line| YearlyWorth::new(scale.utility, &line.account.yearly_growth(year))).collect();
        let ahead: Vec<LongRunMean> = worths.iter().map(|worth| worths[main].beyond(worth)).collect();
        let beyond = |(line, worth): (&StrategyLine, &YearlyWorth)| {
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
