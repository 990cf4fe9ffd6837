//! A report as a table on the screen and as CSV.

use std::fmt::Write;

use ballast::control::evaluation::report::{EvaluationReport, StrategyReport};
use ballast::numerics::statistics::summary::Estimate;
use ballast::report::Csv;

/// Returns the estimates of a strategy, by name.
pub fn estimates(strategy: &StrategyReport) -> Vec<(&'static str, Estimate)> {
    let utility = &strategy.utility;
    let mut found = vec![
        ("mean", utility.mean),
        ("variance", utility.variance),
        ("quantile_20", utility.quantile_20),
        ("quantile_90", utility.quantile_90),
        ("max", extreme(utility.max)),
        ("min", extreme(utility.min)),
        ("certainty_equivalent", strategy.certainty_equivalent),
    ];
    found.extend(wealth(strategy));
    if let Some(difference) = &strategy.difference {
        found.push(("difference_utility", difference.utility));
        found.push(("difference_certainty_equivalent", difference.certainty_equivalent));
    }
    found.extend(strategy.own_mix.map(|own_mix| ("beyond_own_mix", own_mix.beyond)));
    found
}

/// Returns a figure without an interval.
fn extreme(value: f64) -> Estimate {
    Estimate { value, low: f64::NAN, high: f64::NAN }
}

/// Returns the estimates of terminal wealth and of its course.
fn wealth(strategy: &StrategyReport) -> [(&'static str, Estimate); 8] {
    let wealth = &strategy.wealth;
    [
        ("wealth_mean", wealth.mean),
        ("wealth_quantile_20", wealth.quantile_20),
        ("wealth_quantile_90", wealth.quantile_90),
        ("wealth_max", extreme(wealth.max)),
        ("wealth_min", extreme(wealth.min)),
        ("worst_twentieth", wealth.worst_twentieth),
        ("chance_of_loss", wealth.chance_of_loss),
        ("max_drawdown", wealth.max_drawdown),
    ]
}

/// Returns the number of decimals that shows six digits of the initial wealth.
fn decimals(report: &EvaluationReport) -> usize {
    let whole = report.request.problem.initial_wealth.log10().floor() as i32 + 1;
    (6 - whole).clamp(0, 12) as usize
}

/// Returns one line per strategy: certainty equivalent and spread of terminal wealth, and the difference from the
/// reference.
pub fn screen(report: &EvaluationReport) -> String {
    let heads = ["certain", "mean", "20 %", "90 %", "least", "most", "worst 5 %"];
    let heads: String = heads.iter().map(|head| format!("{head:>13}")).collect();
    let mut text = format!("{:<20}{heads}{:>9}{:>9}  certain, less the reference\n", "terminal wealth", "loss", "fall");
    let places = decimals(report);
    for strategy in &report.strategies {
        let StrategyReport { wealth, certainty_equivalent, .. } = strategy;
        let figures = [
            *certainty_equivalent,
            wealth.mean,
            wealth.quantile_20,
            wealth.quantile_90,
            extreme(wealth.min),
            extreme(wealth.max),
            wealth.worst_twentieth,
        ];
        let figures: String = figures.iter().map(|figure| format!("{:>13.places$}", figure.value)).collect();
        let difference = strategy.difference.as_ref().map_or(String::from("(the reference)"), |difference| {
            let Estimate { value, low, high } = difference.certainty_equivalent;
            format!("{value:+.places$} ({low:+.places$} to {high:+.places$})")
        });
        let percent = |share: Estimate| format!("{:.1} %", 100.0 * share.value);
        let (loss, fall) = (percent(wealth.chance_of_loss), percent(wealth.max_drawdown));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:<20}{figures}{loss:>9}{fall:>9}  {difference}", strategy.strategy);
    }
    text + "\n" + &report.sentences.join("\n") + "\n"
}

/// Returns an estimate and both its ends, for CSV.
pub fn ends(estimate: Estimate) -> [String; 3] {
    [estimate.value, estimate.low, estimate.high].map(shown)
}

/// Formats a figure for CSV, empty if there is none.
pub fn shown(figure: f64) -> String {
    if figure.is_nan() { String::new() } else { figure.to_string() }
}

/// Returns one row per strategy and statistic.
pub fn csv(report: &EvaluationReport) -> String {
    let mut csv = Csv::new(&["strategy", "statistic", "value", "low", "high"]);
    for strategy in &report.strategies {
        for (name, Estimate { value, low, high }) in estimates(strategy) {
            let figures = [value, low, high].map(shown);
            csv.row([strategy.strategy.clone(), name.to_owned()].into_iter().chain(figures));
        }
    }
    csv.into_text()
}

/// Returns one row per framework and period, without a radius if the framework has no ball.
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
