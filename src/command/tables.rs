//! A report as a table on the screen and as CSV.

use std::fmt::Write;

use ballast::control::evaluation::report::{EvaluationReport, StrategyReport};
use ballast::numerics::summary::Estimate;
use ballast::report::Csv;

/// The estimates of a strategy, by name.
pub fn estimates(strategy: &StrategyReport) -> Vec<(&'static str, Estimate)> {
    let utility = &strategy.utility;
    let mut found = vec![
        ("mean", utility.mean),
        ("variance", utility.variance),
        ("quantile_20", utility.quantile_20),
        ("quantile_90", utility.quantile_90),
        ("max", utility.max),
        ("min", utility.min),
        ("certainty_equivalent", strategy.certainty_equivalent),
        ("wealth_mean", strategy.wealth.mean),
    ];
    if let Some(difference) = &strategy.difference {
        found.push(("difference_utility", difference.utility));
        found.push(("difference_certainty_equivalent", difference.certainty_equivalent));
    }
    found.extend(strategy.own_mix.map(|own_mix| ("beyond_own_mix", own_mix.beyond)));
    found
}

/// One line a strategy: terminal utility, and the difference to the reference.
pub fn screen(report: &EvaluationReport) -> String {
    let mut text = format!(
        "{:<20}{:>22}{:>10}{:>10}{:>10}{:>10}{:>10}{:>12}  {}\n",
        "terminal utility", "mean", "variance", "20 %", "90 %", "max", "min", "certain", "less the reference"
    );
    for strategy in &report.strategies {
        let utility = &strategy.utility;
        let difference = strategy.difference.as_ref().map_or(String::from("(the reference)"), |difference| {
            let Estimate { value, low, high } = difference.utility;
            format!("{value:+.4} ({low:+.4} to {high:+.4})")
        });
        let reach = 0.5 * (utility.mean.high - utility.mean.low);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<20}{:>22}{:>10.4}{:>10.4}{:>10.4}{:>10.4}{:>10.4}{:>12.4}  {difference}",
            strategy.strategy,
            format!("{:.4} +- {reach:.4}", utility.mean.value),
            utility.variance.value,
            utility.quantile_20.value,
            utility.quantile_90.value,
            utility.max.value,
            utility.min.value,
            strategy.certainty_equivalent.value,
        );
    }
    text + "\n" + &report.sentences.join("\n") + "\n"
}

/// One row a strategy and statistic.
pub fn csv(report: &EvaluationReport) -> String {
    let mut csv = Csv::new(&["strategy", "statistic", "value", "low", "high"]);
    for strategy in &report.strategies {
        for (name, Estimate { value, low, high }) in estimates(strategy) {
            let figures = [value, low, high].map(|figure| figure.to_string());
            csv.row([strategy.strategy.clone(), name.to_owned()].into_iter().chain(figures));
        }
    }
    csv.into_text()
}

/// One row a framework and period; no radius where the framework has no ball.
pub fn periods_csv(report: &EvaluationReport) -> String {
    let mut csv = Csv::new(&[
        "strategy",
        "period",
        "sample_size",
        "allocation_mean",
        "allocation_10",
        "allocation_90",
        "all_bank_share",
        "radius_mean",
        "radius_10",
        "radius_50",
        "radius_90",
    ]);
    for strategy in &report.strategies {
        for period in strategy.periods.iter().flatten() {
            let held = &period.allocation;
            let figures = [held.mean, held.quantile_10, held.quantile_90, period.all_bank_share];
            let radii = match &period.radius {
                Some(r) => [r.mean, r.quantile_10, r.quantile_50, r.quantile_90].map(|radius| radius.to_string()),
                None => Default::default(),
            };
            let names = [strategy.strategy.clone(), period.period.to_string(), period.sample_size.to_string()];
            csv.row(names.into_iter().chain(figures.map(|figure| figure.to_string())).chain(radii));
        }
    }
    csv.into_text()
}
