//! The report as files.

use std::fmt::Display;
use std::path::Path;

use ballast::report::Csv;
use serde_json::{Value, json};

use super::{Backtest, BacktestError, analysis, file, page, verdict};

pub const PAGE: &str = "report.html";

pub fn write(backtest: &Backtest, folder: &Path) -> Result<(), BacktestError> {
    let made = std::fs::create_dir_all(folder);
    made.map_err(|source| BacktestError::Write { path: folder.into(), source })?;
    file(folder, PAGE, &page::page(backtest).html()?)?;
    file(folder, "report.json", &(serde_json::to_string_pretty(&summary(backtest))? + "\n"))?;
    file(folder, "strategies.csv", &strategies(backtest))?;
    file(folder, "periods.csv", &periods(backtest))
}

/// Everything but the periods; a run is told apart by its choices, not by when it was made.
pub fn summary(backtest: &Backtest) -> Value {
    let (args, walk) = (&backtest.args, backtest.walk);
    json!({
        "frequency": backtest.returns.frequency.adjective(),
        "periods_per_year": backtest.returns.periods_per_year,
        "first": backtest.rows().first().map(|row| &row.date),
        "last": backtest.rows().last().map(|row| &row.date),
        "whole_years": backtest.analysis.years,
        "choices": {
            "window": walk.window, "every": walk.every, "horizon": walk.horizon, "alpha": args.alpha, "risk_aversion": args.risk_aversion, "cost_bp": args.cost_bp,
            "cost_blind": args.cost_blind, "count": args.count, "seed": args.seed,
        },
        "intervals": {
            "confidence": analysis::CONFIDENCE, "resamples": analysis::RESAMPLES,
            "period_block": backtest.returns.periods_per_year, "year_block": analysis::YEAR_BLOCK,
        },
        "strategies": backtest.analysis.figures,
        "sentences": verdict::sentences(backtest),
    })
}

fn strategies(backtest: &Backtest) -> String {
    let mut csv = Csv::new(&["strategy", "figure", "value", "low", "high"]);
    for figures in &backtest.analysis.figures {
        let estimates = [
            ("yearly_certainty_equivalent", figures.yearly_certainty_equivalent),
            ("adaptive_ahead", figures.adaptive_ahead),
            ("annual_mean", figures.annual_mean),
            ("annual_volatility", figures.annual_volatility),
            ("sharpe_ratio", figures.sharpe_ratio),
            ("annual_turnover", figures.annual_turnover),
        ];
        for (name, estimate) in estimates {
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
pub fn periods(backtest: &Backtest) -> String {
    let mut csv =
        Csv::new(&["date", "strategy", "allocation", "low", "high", "radius", "traded", "wealth", "drawdown"]);
    for line in &backtest.lines {
        let drawdowns = line.account.drawdowns();
        for (index, (row, decision)) in backtest.rows().iter().zip(&line.decisions).enumerate() {
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
