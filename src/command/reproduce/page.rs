//! The reproduction as a page.

use ballast::control::evaluation::report::{EvaluationReport, StrategyReport};
use ballast::numerics::summary::Estimate;
use ballast::report::{Axis, Cell, Chart, Page, Table, interval, number};

use super::Plan;
use super::findings::Finding;
use super::printed::{MEAN_QUANTILE, PrintedTable, STATISTICS, TABLES};
use super::runs::{CLOSENESS, Case, SAMPLE_SIZE, Section, Study, StudyRow};
use crate::command::tables::estimates;

pub fn page(plan: &Plan, quick: bool, section: &Section, study: &Study, findings: &[Finding]) -> Page {
    let mut page = Page::new("Nonparametric adaptive robust control: section 3 anew").paragraph(format!(
        "Bayraktar and Chen, Nonparametric Adaptive Robust Control Under Model Uncertainty, section 3: {} steps, bank return \
         0.002 a step, exponential utility with risk aversion 0.01, wealth 100, a mixture of two normals, {SAMPLE_SIZE} \
         returns of history, alpha 0.1. Brackets hold 95 % intervals over initial histories.",
        plan.horizon
    ));
    if quick {
        page = page.paragraph("This is the quick run: tiny designs and few histories. Its figures mean little.");
    }
    page = page.section("What holds and what does not").points(findings.iter().map(ToString::to_string));
    page = first_figure(page, section);
    for (index, (case, table)) in section.cases.iter().zip(&TABLES).enumerate() {
        page = one_case(page, index, case, table, section);
    }
    page = frontier(page, &section.all);
    page = coverage(page, &section.all);
    convergence(page, study)
}

fn ends(estimate: Estimate, decimals: usize) -> Cell {
    interval(estimate.value, [estimate.low, estimate.high], decimals)
}

fn first_figure(page: Page, section: &Section) -> Page {
    let quantiles = &section.quantiles;
    let histogram = Chart::histograms("Simulated quantiles", "Q at the start", &[("Q", quantiles.shown.as_slice())]);
    let page = page.section("Figure 1").paragraph(format!(
        "Left: the first {} of {} simulated quantiles of the bridge statistic, whose mean is {:.4} here and {MEAN_QUANTILE} in \
         the paper. Right: the radius as returns come in.",
        quantiles.shown.len(),
        quantiles.drawn,
        quantiles.mean.value
    ));
    let page = page.figure(histogram, "Histogram of Q at t0 = 20 and alpha = 0.1.");
    let periods = section.all.strategy("adaptive").and_then(|adaptive| adaptive.periods.as_deref()).unwrap_or_default();
    let radii = || periods.iter().filter_map(|period| Some((period.sample_size as f64, period.radius?)));
    let chart = Chart::new("Radius", Axis::new("returns seen").tight(), Axis::new("radius, log-return"))
        .band("middle 80 % of paths", radii().map(|(size, radius)| (size, [radius.quantile_10, radius.quantile_90])))
        .line("median", radii().map(|(size, radius)| (size, radius.quantile_50)))
        .line("one path", radii().map(|(size, radius)| (size, radius.first_path)));
    page.figure(chart, "A simulated path of the radius, and where the middle 80 % of paths lie.")
}

fn one_case(page: Page, index: usize, case: &Case, table: &PrintedTable, section: &Section) -> Page {
    let page = page.section(&format!("Table {} and Figure 2, Q near {}", index + 1, case.quantile)).paragraph(format!(
        "{} of {} simulated histories have a Q within {} % of {}: one in {:.0}.",
        case.found,
        section.quantiles.drawn,
        100.0 * CLOSENESS,
        case.quantile,
        section.quantiles.drawn as f64 / case.found.max(1) as f64
    ));
    let Some(report) = &case.report else { return page };
    let mut page = page;
    for (strategy, name) in
        [("adaptive", "Adaptive robust (AR)"), ("known_law", "True law (TR)"), ("static", "Static robust (SR)")]
    {
        let (Some(own), Some(all), Some(column)) =
            (report.strategy(strategy), section.all.strategy(strategy), table.column(strategy))
        else {
            continue;
        };
        page = page.table(statistics(name, column, own, all, report, &section.all));
    }
    let [adaptive, known] = &case.utilities;
    let chart = Chart::histograms(
        "Terminal utility",
        "terminal utility",
        &[("adaptive robust", adaptive.as_slice()), ("known law", known.as_slice())],
    );
    page.figure(chart, &format!("Terminal utility of AR and TR, Q near {}.", case.quantile))
}

fn statistics(
    name: &str,
    column: &[f64; 6],
    own: &StrategyReport,
    all: &StrategyReport,
    report: &EvaluationReport,
    everywhere: &EvaluationReport,
) -> Table {
    let close = format!("here, {} such histories of {} paths", report.histories.len(), report.request.paths);
    let whole = format!("here, {} histories of {} paths", everywhere.histories.len(), everywhere.request.paths);
    let mut table = Table::new(name, &["terminal utility", "paper", &close, &whole]);
    let (own, all) = (estimates(own), estimates(all));
    for (((_, label), paper), ((_, own), (_, all))) in STATISTICS.iter().zip(column).zip(own.into_iter().zip(all)) {
        table = table.row([Cell::from(*label), number(*paper, 4), ends(own, 4), ends(all, 4)]);
    }
    table
}

fn frontier(page: Page, report: &EvaluationReport) -> Page {
    let point = |strategy: &StrategyReport| (strategy.utility.variance.value, strategy.utility.mean.value);
    let mixes = report.strategies.iter().filter(|strategy| strategy.constant_mix.is_some());
    let mut chart = Chart::new(
        "Mean and variance of terminal utility",
        Axis::new("variance of terminal utility"),
        Axis::new("mean terminal utility"),
    )
    .line("constant mixes", mixes.map(point));
    for (name, strategy) in [("adaptive", "adaptive"), ("known law", "known_law"), ("static", "static")] {
        chart = chart.scatter(name, report.strategy(strategy).map(point));
    }
    chart = chart.scatter("AR as printed", TABLES.iter().map(|table| (table.adaptive[1], table.adaptive[0])));
    let mut table = Table::new(
        "All strategies, all histories",
        &["strategy", "mean", "variance", "certainty equivalent", "mean less AR"],
    );
    for strategy in &report.strategies {
        let difference = strategy.difference.as_ref().map_or(Cell::from("the reference"), |of| ends(of.utility, 4));
        let utility = &strategy.utility;
        let certain = ends(strategy.certainty_equivalent, 4);
        table = table.row([
            Cell::from(strategy.strategy.as_str()),
            ends(utility.mean, 4),
            ends(utility.variance, 3),
            certain,
            difference,
        ]);
    }
    page.section("The frontier of constant mixes")
        .figure(
            chart,
            "What a constant share in stocks, 0 to 1 by 0.1, earns at what variance, and the frameworks beside it.",
        )
        .table(table)
        .figure(allocations(report), "Mean allocation of the frameworks, and the middle 80 % of adaptive paths.")
}

fn allocations(report: &EvaluationReport) -> Chart {
    let mut chart = Chart::new("Allocation", Axis::new("period").tight(), Axis::new("share in stocks").from_zero());
    for strategy in &report.strategies {
        let Some(periods) = &strategy.periods else { continue };
        if strategy.strategy == "adaptive" {
            let band = |of: &ballast::control::evaluation::report::PeriodReport| {
                (of.period as f64, [of.allocation.quantile_10, of.allocation.quantile_90])
            };
            chart = chart.band("adaptive", periods.iter().map(band));
        }
        chart = chart.line(&strategy.strategy, periods.iter().map(|of| (of.period as f64, of.allocation.mean)));
    }
    chart
}

fn coverage(page: Page, report: &EvaluationReport) -> Page {
    let Some(coverage) = report.strategy("adaptive").and_then(|adaptive| adaptive.coverage.as_ref()) else {
        return page;
    };
    let sizes = || coverage.by_sample_size.iter();
    let chart = Chart::new("Coverage", Axis::new("returns seen").tight(), Axis::new("share of steps"))
        .band("95 % interval", sizes().map(|at| (at.sample_size as f64, [at.covered.low, at.covered.high])))
        .line("held the true law", sizes().map(|at| (at.sample_size as f64, at.covered.value)))
        .line("1 - alpha", sizes().map(|at| (at.sample_size as f64, coverage.target.unwrap_or(f64::NAN))));
    page.section("Does the ball hold the true law?")
        .paragraph(format!(
            "On {:.1} % of paths ({:.1} to {:.1} %) the ball of some period does not.",
            100.0 * coverage.ever_left.value,
            100.0 * coverage.ever_left.low,
            100.0 * coverage.ever_left.high
        ))
        .figure(chart, "Share of steps at which the ball held the true law, by sample size.")
}

fn convergence(page: Page, study: &Study) -> Page {
    let mut table = Table::new(
        "Gaps to the known law, in terminal utility",
        &["returns of history", "framework", "mean radius", "value gap", "realised gap"],
    );
    for row in &study.rows {
        table = table.row([
            number(row.sample_size as f64, 0),
            Cell::from(row.strategy.as_str()),
            number(row.radius, 4),
            ends(row.value_gap, 4),
            ends(row.realised_gap, 4),
        ]);
    }
    let gaps = |of: fn(&StudyRow) -> f64, title: &str| {
        let mut chart =
            Chart::new(title, Axis::new("returns of history").log(), Axis::new("gap, terminal utility").log());
        for strategy in ["adaptive", "static"] {
            let own = study.rows.iter().filter(|row| row.strategy == strategy && of(row) > 0.0);
            chart = chart.line(strategy, own.map(|row| (row.sample_size as f64, of(row))));
        }
        if let Some(first) = study.rows.first() {
            let start = of(first);
            let rate = |row: &StudyRow| {
                let ratio = row.sample_size as f64 / first.sample_size as f64;
                (row.sample_size as f64, start * ratio.powf(-0.5))
            };
            chart = chart.line("rate -1/2", study.rows.iter().filter(|row| row.strategy == "adaptive").map(rate));
        }
        chart
    };
    let mut slopes =
        Table::new("Fitted powers of t0; section 2.4 predicts -0.5", &["framework", "gap", "all", "last two"]);
    for slope in &study.slopes {
        slopes = slopes.row([
            Cell::from(slope.strategy.as_str()),
            Cell::from(slope.gap),
            number(slope.all, 2),
            number(slope.last, 2),
        ]);
    }
    page.section("Convergence to the known law")
        .paragraph(
            "The value gap is what the known law is worth at the start less what the framework promises there, the gap of \
             section 2.4; the realised gap is what it cost on the same simulated returns.",
        )
        .figure(gaps(|row| row.value_gap.value, "Value gap"), "The value gap against the length of the history.")
        .figure(gaps(|row| row.realised_gap.value, "Realised gap"), "The realised gap against the length of the history.")
        .table(table)
        .table(slopes)
}
