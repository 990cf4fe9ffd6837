//! The report as files.

use std::fmt::Display;
use std::path::Path;

use ballast::report::Csv;

use super::{BacktestError, Shown, file, page};

pub const PAGE: &str = "report.html";

pub fn write(shown: &Shown, folder: &Path) -> Result<(), BacktestError> {
    let made = std::fs::create_dir_all(folder);
    made.map_err(|source| BacktestError::Write { path: folder.into(), source })?;
    file(folder, PAGE, &page::page(shown).html()?)?;
    file(folder, "report.json", &(serde_json::to_string_pretty(&shown.report)? + "\n"))?;
    file(folder, "strategies.csv", &strategies(shown))?;
    file(folder, "periods.csv", &periods(shown))
}

fn strategies(shown: &Shown) -> String {
    let mut csv = Csv::new(&["strategy", "figure", "value", "low", "high"]);
    for figures in &shown.report.strategies {
        let estimates = [
            ("yearly_certainty_equivalent", figures.yearly_certainty_equivalent),
            ("adaptive_ahead", figures.adaptive_ahead),
            ("annual_mean", figures.annual_mean),
            ("annual_volatility", figures.annual_volatility),
            ("sharpe_ratio", figures.sharpe_ratio),
            ("annual_turnover", figures.annual_turnover),
        ];
        let beyond = figures.beyond_own_mix.map(|beyond| ("beyond_own_mix", beyond));
        for (name, estimate) in estimates.into_iter().chain(beyond) {
            let [low, high] = estimate.interval;
            let fields: [&dyn Display; 5] = [&figures.strategy, &name, &estimate.value, &low, &high];
            csv.row(fields);
        }
        let plain = [
            ("max_drawdown", figures.max_drawdown),
            ("final_wealth", figures.final_wealth),
            ("mean_allocation", figures.mean_allocation),
            ("all_bank_share", figures.all_bank_share),
        ];
        for (name, value) in plain {
            let fields: [&dyn Display; 5] = [&figures.strategy, &name, &value, &"", &""];
            csv.row(fields);
        }
    }
    csv.into_text()
}

/// One line a period and strategy; wealth and drawdown at its end.
pub fn periods(shown: &Shown) -> String {
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
