//! The report as files.

use std::fmt::Display;
use std::path::Path;

use ballast::control::evaluation::backtest_report::{BacktestFigures, BootstrapEstimate, Performance};
use ballast::report::Csv;
use serde::Serialize;

use super::{BacktestError, BacktestPage, file};

pub const PAGE: &str = "report.html";

/// A figure of a strategy, with its interval if it has one.
pub type StrategyFigure = (&'static str, f64, Option<[f64; 2]>);

pub fn write(
    folder: &Path,
    page: &str,
    report: &impl Serialize,
    strategies: &str,
    periods: &str,
) -> Result<(), BacktestError> {
    let made = std::fs::create_dir_all(folder);
    made.map_err(|source| BacktestError::Write { path: folder.into(), source })?;
    file(folder, PAGE, page)?;
    file(folder, "report.json", &(serde_json::to_string_pretty(report)? + "\n"))?;
    file(folder, "strategies.csv", strategies)?;
    file(folder, "periods.csv", periods)
}

pub fn estimated(name: &'static str, estimate: BootstrapEstimate) -> StrategyFigure {
    (name, estimate.value, Some(estimate.interval))
}

pub fn plain(name: &'static str, value: f64) -> StrategyFigure {
    (name, value, None)
}

/// Returns one line per strategy and figure.
pub fn figures(strategies: impl IntoIterator<Item = (String, Vec<StrategyFigure>)>) -> String {
    let mut csv = Csv::new(&["strategy", "figure", "value", "low", "high"]);
    for (strategy, figures) in strategies {
        for (name, value, interval) in figures {
            let [low, high] = interval.map_or_else(Default::default, |ends| ends.map(|end| end.to_string()));
            let fields: [&dyn Display; 5] = [&strategy, &name, &value, &low, &high];
            csv.row(fields);
        }
    }
    csv.into_text()
}

/// Returns the figures of a strategy's variation, its trades, and its losses in bad years.
pub fn of_returns(performance: &Performance) -> [StrategyFigure; 6] {
    [
        estimated("annual_mean", performance.annual_mean),
        estimated("annual_volatility", performance.annual_volatility),
        estimated("sharpe_ratio", performance.sharpe_ratio),
        estimated("annual_turnover", performance.annual_turnover),
        estimated("chance_of_loss", performance.chance_of_loss),
        estimated("worst_twentieth", performance.worst_twentieth),
    ]
}

/// Returns the figures of a strategy's wealth and holdings.
pub fn of_wealth(performance: &Performance) -> [StrategyFigure; 3] {
    [
        plain("max_drawdown", performance.max_drawdown),
        plain("final_wealth", performance.final_wealth),
        plain("mean_allocation", performance.mean_allocation),
    ]
}

pub fn strategies(strategies: &[BacktestFigures]) -> String {
    let of = |figures: &BacktestFigures| {
        let mut all = vec![
            estimated("yearly_certainty_equivalent", figures.performance.yearly_certainty_equivalent),
            estimated("adaptive_ahead", figures.adaptive_ahead),
        ];
        all.extend(figures.place.map(|place| plain("place", place as f64)));
        all.extend(of_returns(&figures.performance));
        all.extend(figures.performance.beyond_own_mix.map(|beyond| estimated("beyond_own_mix", beyond)));
        all.extend(of_wealth(&figures.performance));
        all.push(plain("all_bank_share", figures.all_bank_share));
        (figures.strategy.clone(), all)
    };
    figures(strategies.iter().map(of))
}

/// Returns one line per period and strategy; wealth and drawdown at its end.
pub fn periods(shown: &BacktestPage) -> String {
    let mut csv =
        Csv::new(&["date", "strategy", "allocation", "low", "high", "radius", "traded", "wealth", "drawdown"]);
    for line in &shown.walked.lines {
        let drawdowns = line.account.drawdowns();
        for (index, (row, decision)) in shown.rows().iter().zip(&line.decisions).enumerate() {
            let fields: [&dyn Display; 9] = [
                &row.date,
                &line.name,
                &line.account.allocations[index],
                &decision.band.low,
                &decision.band.high,
                &decision.radius,
                &line.account.traded[index],
                &line.account.wealth[index + 1],
                &drawdowns[index + 1],
            ];
            csv.row(fields);
        }
    }
    csv.into_text()
}
