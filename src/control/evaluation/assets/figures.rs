//! Turns the accounts of several assets into the report.

use super::report::{AssetsBacktestReport, AssetsFigures, AssetsPeriods, FORMAT};
use super::words::sentences;
use super::{AssetsLine, AssetsWalked};
use crate::control::assets::advice::named;
use crate::control::evaluation::account::uncounted_periods;
use crate::control::evaluation::backtest_report::BootstrapEstimate;
use crate::control::evaluation::resampling::{ResampledFigures, StrategySeries, intervals};
use crate::control::evaluation::yearly_worth::{Scale, YearlyWorth, present_at_once};

/// Returns the index of the strategy with all wealth in equal shares: the last but one.
fn reference(lines: &[AssetsLine]) -> usize {
    lines.len() - 2
}

impl AssetsBacktestReport {
    /// Builds the report of a finished walk-forward.
    pub fn new(walked: &AssetsWalked) -> Self {
        let AssetsWalked { backtest, lines } = walked;
        let (record, choices) = (&backtest.record, &backtest.choices);
        let (year, seed) = (record.periods_per_year, choices.seed);
        let series: Vec<StrategySeries> = lines.iter().map(|line| StrategySeries::of(&line.account, year)).collect();
        let scale = Scale { periods_per_year: year, utility: backtest.utility(), seed };
        let resampled = ResampledFigures::of(&series, backtest.bank(), &scale);
        let performance = compared(lines, &scale).into_iter().enumerate();
        let strategies: Vec<AssetsFigures> =
            performance.map(|(index, compared)| figures(walked, index, compared, &resampled)).collect();
        AssetsBacktestReport {
            format: FORMAT.to_owned(),
            assets: record.assets.clone(),
            frequency: record.frequency.adjective().to_owned(),
            periods_per_year: year,
            dates: backtest.dates().to_vec(),
            whole_years: backtest.lived().len() / year,
            uncounted_periods: uncounted_periods(backtest.lived().len(), year),
            choices: choices.clone(),
            intervals: intervals(year, lines.len() - 1),
            periods: lines.iter().map(|line| periods(&record.assets, line)).collect(),
            sentences: sentences(walked, &strategies),
            strategies,
        }
    }
}

/// A strategy's worth and rank, its excess over equal shares, and its excess over equal shares at its own average
/// total.
struct Compared {
    place: usize,
    worth: BootstrapEstimate,
    beyond_equal: Option<BootstrapEstimate>,
    beyond_own_mix: Option<BootstrapEstimate>,
}

fn compared(lines: &[AssetsLine], scale: &Scale) -> Vec<Compared> {
    let worth =
        |line: &AssetsLine| YearlyWorth::new(scale.utility, &line.account.yearly_growth(scale.periods_per_year));
    let worths: Vec<YearlyWorth> = lines.iter().map(worth).collect();
    let equal = reference(lines);
    let ahead = worths.iter().enumerate().map(|(index, worth)| (index != equal).then(|| worth.beyond(&worths[equal])));
    let beyond = lines
        .iter()
        .zip(&worths)
        .map(|(line, worth)| line.own_mix.as_ref().map(|mix| worth.beyond_own_mix(&line.account, mix, scale)));
    let ahead = present_at_once(ahead.collect(), scale.seed);
    let beyond = present_at_once(beyond.collect(), scale.seed);
    let all = worths.iter().zip(ahead).zip(beyond);
    all.map(|((worth, beyond_equal), beyond_own_mix)| Compared {
        place: worth.place(worths.iter()),
        worth: worth.estimate(),
        beyond_equal,
        beyond_own_mix,
    })
    .collect()
}

fn figures(walked: &AssetsWalked, index: usize, compared: Compared, resampled: &ResampledFigures) -> AssetsFigures {
    let line = &walked.lines[index];
    let assets = &walked.backtest.record.assets;
    let mean = |asset: usize| line.held.iter().map(|shares| shares[asset]).sum::<f64>() / line.held.len() as f64;
    AssetsFigures {
        strategy: line.name.clone(),
        kind: line.strategy.rule.kind(),
        place: compared.place,
        performance: resampled.performance(index, &line.account, compared.worth, compared.beyond_own_mix),
        beyond_equal: compared.beyond_equal,
        effective_assets: effective_assets(&line.held),
        mean_allocations: named(assets, &(0..assets.len()).map(mean).collect::<Vec<f64>>()),
    }
}

/// Returns `(sum a)^2 / sum a^2`, averaged over the periods in which anything is held.
fn effective_assets(held: &[Vec<f64>]) -> Option<f64> {
    let of = |shares: &Vec<f64>| {
        let squares = shares.iter().map(|share| share * share).sum::<f64>();
        (squares > 0.0).then(|| shares.iter().sum::<f64>().powi(2) / squares)
    };
    let numbers: Vec<f64> = held.iter().filter_map(of).collect();
    (!numbers.is_empty()).then(|| numbers.iter().sum::<f64>() / numbers.len() as f64)
}

fn periods(assets: &[String], line: &AssetsLine) -> AssetsPeriods {
    let of = |(asset, name): (usize, &String)| {
        (name.clone(), line.held.iter().map(|shares| shares[asset]).collect::<Vec<f64>>())
    };
    AssetsPeriods {
        strategy: line.name.clone(),
        allocations: assets.iter().enumerate().map(of).collect(),
        radius: line.radii.clone(),
        traded: line.account.traded.clone(),
        wealth: line.account.wealth[1..].to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_shares_are_as_many_assets_as_there_are_and_one_is_one() {
        let held = [vec![0.1, 0.1, 0.1, 0.1], vec![0.0; 4], vec![0.0, 0.9, 0.0, 0.0]];
        assert_eq!(effective_assets(&held[..2]), Some(4.0));
        assert_eq!(effective_assets(&held), Some(2.5));
        assert_eq!(effective_assets(&held[1..2]), None);
        // (0.3 + 0.1)^2 / (0.09 + 0.01).
        assert!((effective_assets(&[vec![0.3, 0.1]]).unwrap() - 1.6).abs() < 1e-12);
    }
}
