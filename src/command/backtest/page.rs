//! The report as a page.

use ballast::control::evaluation::analysis::Line;
use ballast::control::evaluation::backtest_report::{BootstrapEstimate, Performance};
use ballast::control::evaluation::resampling::{CONFIDENCE, RESAMPLES, YEAR_BLOCK};
use ballast::report::{Axis, BarChart, Chart, Page, Table, interval, number};

use super::{Row, Shown};

pub fn page(shown: &Shown) -> Page {
    let date = |row: Option<&Row>| row.map_or(String::new(), |row| row.date.clone());
    let (first, last) = (date(shown.rows().first()), date(shown.rows().last()));
    let noun = noun(shown);
    let performances = shown.report.strategies.iter().map(|figures| (figures.strategy.as_str(), &figures.performance));
    Page::new(&format!("Walk-forward, {first} to {last}"))
        .paragraph(method(shown))
        .section("What it shows")
        .points(shown.report.sentences.clone())
        .table(utility_table(shown))
        .figure(certainty_equivalents(shown), &of_years(shown.report.whole_years))
        .section("Wealth")
        .figure(wealth(shown), "Equal ratios take equal room. The start is 100, all in the bank.")
        .figure(drawdowns(shown), "How far wealth is below its highest so far.")
        .table(performance_table(performances))
        .section("What was held")
        .figure(allocations(shown), &format!("Share of wealth in the risky asset at the start of each {noun}."))
        .figure(
            radii(shown),
            &format!("Radius of the Wasserstein ball that {noun}; static ones keep theirs until the next training."),
        )
        .section("How it was done")
        .points(notes(shown))
}

/// Of the line most is said about.
fn main_name(shown: &Shown) -> &str {
    &shown.walked.lines[shown.walked.backtest.main_line()].name
}

fn noun(shown: &Shown) -> &'static str {
    shown.returns.frequency.noun()
}

/// So many periods, in words.
fn periods(shown: &Shown, count: usize) -> String {
    counted(count, noun(shown))
}

pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

fn method(shown: &Shown) -> String {
    let (walk, noun) = (&shown.walked.backtest.walk, noun(shown));
    format!(
        "{} Every {} a policy is trained on the {} before, for a horizon of {}, and lived by until the next: each {noun} it \
         is asked, held to, and told the return. Nothing later than a {noun} is used for its allocation. Relative risk \
         aversion {}.",
        shown.returns.sentence().replace('\n', " "),
        periods(shown, walk.every),
        periods(shown, walk.window),
        periods(shown, walk.horizon),
        walk.risk_aversion
    )
}

/// What certainty equivalents are.
pub fn of_years(years: usize) -> String {
    format!(
        "Mean utility over {years} years, each from 100, as wealth for certain, with {:.0} % intervals.",
        100.0 * CONFIDENCE
    )
}

/// How intervals are made, from such blocks of periods.
pub fn intervals(block: &str) -> String {
    format!(
        "Intervals are the middle {:.0} % of {RESAMPLES} circular block-bootstrap resamples, alike for all strategies: \
         blocks of {block}, and of {YEAR_BLOCK} years for certainty equivalents and losses. They take the past as one \
         draw of a stationary world, so they are too narrow for what was never seen. The chance of loss and the worst 5 % are \
         of years that begin with every period, so that they overlap: how many end with less than they began with, and what the \
         worst twentieth of them returned on average.",
        100.0 * CONFIDENCE
    )
}

fn notes(shown: &Shown) -> Vec<String> {
    let (choices, noun) = (&shown.report.choices, noun(shown));
    let block = periods(shown, shown.returns.periods_per_year);
    vec![
        format!("Design points a step {}, seed {}; took {:.0} s.", choices.count, choices.seed, shown.seconds),
        format!(
            "Balls have {} times the radius of the bridge around {}.",
            choices.scale,
            choices.centre.in_words(choices.window)
        ),
        format!(
            "A policy takes the bank to go on paying what it paid in the last {noun} before its training; accounts are \
             credited with what it really paid."
        ),
        intervals(&block),
        "The constant mix of the adaptive strategy's average allocation was chosen with hindsight; it is there to measure \
         timing, not to be had."
            .into(),
        "Turnover is the share of wealth that changes between bank and asset, counted once. Drawdown and final wealth \
         belong to one path and carry no interval."
            .into(),
    ]
}

/// Dates as years and their parts.
fn years(shown: &Shown) -> Vec<f64> {
    shown.rows().iter().map(|row| row.time).collect()
}

pub fn time() -> Axis {
    Axis::new("year").tight()
}

/// Strategies that could have been followed.
fn followed(shown: &Shown) -> impl Iterator<Item = &Line> {
    shown.walked.lines.iter().filter(|line| !line.hindsight)
}

/// The start, and the ends of periods that start at these times.
pub fn ends(starts: &[f64], periods_per_year: usize) -> Vec<f64> {
    let period = 1.0 / periods_per_year as f64;
    starts.first().copied().into_iter().chain(starts.iter().map(|start| start + period)).collect()
}

fn wealth(shown: &Shown) -> Chart {
    let times = ends(&years(shown), shown.returns.periods_per_year);
    let chart = Chart::new("Wealth", time(), Axis::new("wealth, logarithmic").log());
    // The cost-blind strategy lies too close beside the one it is compared with, and a chart holds eight lines.
    let blind = shown.walked.backtest.blind_line();
    followed(shown).filter(|line| line.name != blind).fold(chart, |chart, line| {
        chart.line(&line.name, times.iter().copied().zip(line.account.wealth.iter().copied()))
    })
}

/// The adaptive strategy most is said about and two everybody knows: more cover each other.
fn drawdowns(shown: &Shown) -> Chart {
    let years = years(shown);
    let chart = Chart::new("Drawdown", time(), Axis::new("below the highest wealth so far, %").from_zero());
    let main = main_name(shown);
    let names = ["all-stock", "60/40", main];
    names.iter().filter_map(|name| shown.walked.lines.iter().find(|line| line.name == *name)).fold(
        chart,
        |chart, line| {
            let falls = line.account.drawdowns().into_iter().skip(1).map(|fall| -100.0 * fall);
            chart.line(&line.name, years.iter().copied().zip(falls))
        },
    )
}

fn allocations(shown: &Shown) -> Chart {
    let years = years(shown);
    let chart = Chart::new("Allocation", time(), Axis::new("share of wealth, %").from_zero());
    trained(shown).fold(chart, |chart, line| {
        let shares = line.account.allocations.iter().map(|allocation| 100.0 * allocation);
        chart.line(&line.name, years.iter().copied().zip(shares))
    })
}

fn radii(shown: &Shown) -> Chart {
    let years = years(shown);
    let chart = Chart::new("Radius", time(), Axis::new(&format!("log-return a {}, %", noun(shown))).from_zero());
    trained(shown).filter(|line| line.decisions.iter().any(|decision| decision.radius > 0.0)).fold(
        chart,
        |chart, line| {
            let radii = line.decisions.iter().map(|decision| 100.0 * decision.radius);
            chart.line(&line.name, years.iter().copied().zip(radii))
        },
    )
}

fn trained(shown: &Shown) -> impl Iterator<Item = &Line> {
    followed(shown).filter(|line| line.decisions.iter().any(|decision| decision.source.is_some()))
}

fn certainty_equivalents(shown: &Shown) -> BarChart {
    let figures = shown.report.strategies.iter();
    beyond_100(figures.map(|figures| (figures.strategy.as_str(), figures.performance.yearly_certainty_equivalent)))
}

/// From 100 on, what a year adds: bars from zero would all look alike.
pub fn beyond_100<'a>(strategies: impl Iterator<Item = (&'a str, BootstrapEstimate)>) -> BarChart {
    let chart = BarChart::new("What a year from 100 counts as, beyond 100", Axis::new("certainty equivalent less 100"));
    strategies.fold(chart, |chart, (name, BootstrapEstimate { value, interval: [low, high] })| {
        chart.bar(name, value - 100.0, Some([low - 100.0, high - 100.0]))
    })
}

fn utility_table(shown: &Shown) -> Table {
    let main = main_name(shown);
    let table = Table::new(
        "Certainty equivalents of a year from 100",
        &[
            "strategy",
            "certainty equivalent",
            &format!("{main} less this"),
            "beyond its own mix",
            "mean allocation, %",
            &format!("all-bank {}s, %", noun(shown)),
        ],
    );
    shown.report.strategies.iter().fold(table, |table, figures| {
        table.row([
            figures.strategy.as_str().into(),
            estimate(figures.performance.yearly_certainty_equivalent, 1.0, 2),
            if figures.strategy == *main { number(f64::NAN, 2) } else { estimate(figures.adaptive_ahead, 1.0, 2) },
            figures.performance.beyond_own_mix.map_or_else(|| number(f64::NAN, 2), |beyond| estimate(beyond, 1.0, 2)),
            number(100.0 * figures.performance.mean_allocation, 1),
            number(100.0 * figures.all_bank_share, 0),
        ])
    })
}

/// Of strategies by name.
pub fn performance_table<'a>(strategies: impl Iterator<Item = (&'a str, &'a Performance)>) -> Table {
    let table = Table::new(
        "Performance, a year",
        &[
            "strategy",
            "mean, %",
            "volatility, %",
            "Sharpe ratio",
            "turnover, %",
            "chance of loss, %",
            "worst 5 % of years, %",
            "max drawdown, %",
            "final wealth",
        ],
    );
    strategies.fold(table, |table, (strategy, performance)| {
        table.row([
            strategy.into(),
            estimate(performance.annual_mean, 100.0, 2),
            estimate(performance.annual_volatility, 100.0, 2),
            estimate(performance.sharpe_ratio, 1.0, 2),
            estimate(performance.annual_turnover, 100.0, 0),
            estimate(performance.chance_of_loss, 100.0, 1),
            estimate(performance.worst_twentieth, 100.0, 1),
            number(100.0 * performance.max_drawdown, 1),
            number(performance.final_wealth, 0),
        ])
    })
}

pub fn estimate(estimate: BootstrapEstimate, unit: f64, decimals: usize) -> ballast::report::Cell {
    interval(unit * estimate.value, estimate.interval.map(|end| unit * end), decimals)
}
