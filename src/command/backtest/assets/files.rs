//! The report of several assets as tables.

use ballast::control::evaluation::assets::report::{AssetsBacktestReport, AssetsFigures};
use ballast::report::Csv;

use super::AssetsBacktestPage;
use crate::command::backtest::files::{estimated, figures, of_returns, of_wealth, plain};

pub fn strategies(report: &AssetsBacktestReport) -> String {
    let of = |one: &AssetsFigures| {
        let mut all = vec![estimated("yearly_certainty_equivalent", one.performance.yearly_certainty_equivalent)];
        all.push(plain("place", one.place as f64));
        all.extend(one.beyond_equal.map(|beyond| estimated("beyond_equal", beyond)));
        all.extend(one.performance.beyond_own_mix.map(|beyond| estimated("beyond_own_mix", beyond)));
        all.extend(of_returns(&one.performance));
        all.extend(of_wealth(&one.performance));
        all.extend(one.effective_assets.map(|number| plain("effective_assets", number)));
        (one.strategy.clone(), all)
    };
    figures(report.strategies.iter().map(of))
}

/// Returns one line per period and strategy, with a column for the holding of each asset; wealth and drawdown at its
/// end.
pub fn periods(shown: &AssetsBacktestPage) -> String {
    let assets = &shown.report.assets;
    let header = ["date", "strategy", "allocation", "radius", "traded", "wealth", "drawdown"];
    let held: Vec<String> = assets.iter().map(|asset| format!("held: {asset}")).collect();
    let header: Vec<&str> = header.into_iter().chain(held.iter().map(String::as_str)).collect();
    let mut csv = Csv::new(&header);
    for line in &shown.walked.lines {
        let drawdowns = line.account.drawdowns();
        for (index, (date, shares)) in shown.report.dates.iter().zip(&line.held).enumerate() {
            let figures = [
                line.account.allocations[index],
                line.radii[index],
                line.account.traded[index],
                line.account.wealth[index + 1],
                drawdowns[index + 1],
            ];
            let words = [date.clone(), line.name.clone()];
            csv.row(words.into_iter().chain(figures.iter().chain(shares).map(f64::to_string)));
        }
    }
    csv.into_text()
}
