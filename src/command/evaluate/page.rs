//! The report as a page.

use ballast::control::evaluation::report::{EvaluationReport, StrategyReport};
use ballast::numerics::summary::Estimate;
use ballast::report::{Axis, BarChart, Cell, Page, Table, interval, number};

use crate::command::tables::decimals;

pub fn page(report: &EvaluationReport) -> Page {
    let (request, costs) = (&report.request, report.costs);
    let level = 100.0 * request.level;
    let places = decimals(report).min(4);
    let title =
        format!("{} strategies on {} simulated paths", report.strategies.len(), request.paths * report.histories.len());
    let page = Page::new(&title).paragraph(compared(report)).section("What it shows").points(report.sentences.clone());
    let page = match report.strategies.len() {
        1 => page,
        _ => page.figure(
            apart(report),
            &format!("Differences to {} on the same returns, with {level:.0} % intervals.", report.reference),
        ),
    };
    page.table(wealth(report, places))
        .table(losses(report, places))
        .section("How it was done")
        .points([
            format!(
                "Brackets hold {level:.0} % intervals. The largest and the smallest are those of the paths of one history, averaged \
                 over histories."
            ),
            "A loss is to end with less than was put in. A fall is below the highest wealth so far, the largest of a path averaged \
             over paths; what is added or withdrawn is neither gain nor fall."
                .into(),
            "The mix of a strategy's own average allocation was chosen with hindsight; it is there to measure timing, not to be had."
                .into(),
            format!("Seed {}; trained in {:.1} s, simulated in {:.1} s.", request.seed, costs.training_seconds, costs.simulation_seconds),
        ])
}

/// Certainty equivalents less that of the reference.
fn apart(report: &EvaluationReport) -> BarChart {
    let axis = Axis::new("certainty equivalent, less that of the reference");
    let bars =
        report.strategies.iter().filter_map(|one| Some((&one.strategy, one.difference.as_ref()?.certainty_equivalent)));
    bars.fold(BarChart::new("What it is worth to end so", axis), |chart, (name, Estimate { value, low, high })| {
        chart.bar(name, value, Some([low, high]))
    })
}

fn compared(report: &EvaluationReport) -> String {
    let problem = &report.request.problem;
    format!(
        "Every strategy starts with {} and meets the same returns: {} paths of {} periods from {} of {} returns. The bank pays {} % \
         a period; of what is traded {} % is lost.",
        problem.initial_wealth,
        report.request.paths,
        problem.horizon,
        match report.histories.len() {
            1 => "one history".to_owned(),
            count => format!("each of {count} histories"),
        },
        problem.history.len(),
        100.0 * problem.rate_per_step,
        100.0 * problem.trading_cost
    )
}

fn ends(Estimate { value, low, high }: Estimate, unit: f64, places: usize) -> Cell {
    interval(unit * value, [unit * low, unit * high], places)
}

fn wealth(report: &EvaluationReport, places: usize) -> Table {
    let less = format!("less {}", report.reference);
    let header =
        ["strategy", "certainty equivalent", &less, "beyond its own mix", "mean", "20 %", "90 %", "least", "most"];
    let none = || number(f64::NAN, 0);
    report.strategies.iter().fold(Table::new("Terminal wealth", &header), |table, strategy| {
        let StrategyReport { wealth, difference, own_mix, .. } = strategy;
        let plain = |estimate: Estimate| number(estimate.value, places);
        table.row([
            strategy.strategy.as_str().into(),
            ends(strategy.certainty_equivalent, 1.0, places),
            difference.as_ref().map_or_else(none, |less| ends(less.certainty_equivalent, 1.0, places)),
            own_mix.map_or_else(none, |own| ends(own.beyond, 1.0, places)),
            ends(wealth.mean, 1.0, places),
            plain(wealth.quantile_20),
            plain(wealth.quantile_90),
            plain(wealth.min),
            plain(wealth.max),
        ])
    })
}

fn losses(report: &EvaluationReport, places: usize) -> Table {
    let header = ["strategy", "chance of loss, %", "worst 5 %, mean wealth", "largest fall, %"];
    report.strategies.iter().fold(Table::new("Losses", &header), |table, StrategyReport { strategy, wealth, .. }| {
        table.row([
            strategy.as_str().into(),
            ends(wealth.chance_of_loss, 100.0, 1),
            ends(wealth.worst_twentieth, 1.0, places),
            ends(wealth.max_drawdown, 100.0, 1),
        ])
    })
}
