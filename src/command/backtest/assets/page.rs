//! The report of several assets as a page.

use ballast::control::evaluation::assets::AssetsLine;
use ballast::control::evaluation::assets::report::AssetsFigures;
use ballast::control::evaluation::assets::rules::Rule;
use ballast::control::evaluation::backtest_report::BootstrapEstimate;
use ballast::report::{Axis, Cell, Chart, Page, Table, number};

use super::Shown;
use crate::command::backtest::page::{
    beyond_100, counted, ends, estimate, intervals, of_years, performance_table, time,
};

pub fn page(shown: &Shown) -> Page {
    let date = |date: Option<&String>| date.cloned().unwrap_or_default();
    let (first, last) = (date(shown.report.dates.first()), date(shown.report.dates.last()));
    let strategies = shown.report.strategies.iter();
    let values = strategies.map(|figures| (figures.strategy.as_str(), figures.performance.yearly_certainty_equivalent));
    let page = Page::new(&format!("Walk-forward of {} assets, {first} to {last}", shown.report.assets.len()))
        .paragraph(method(shown))
        .section("What it shows")
        .points(shown.report.sentences.clone())
        .table(utility_table(shown))
        .figure(beyond_100(values), &of_years(shown.report.whole_years))
        .section("Wealth");
    let windows = || shown.report.choices.windows.iter().copied();
    let known = |window| shown.walked.backtest.window_in_words(window);
    let page = windows().fold(page, |page, window| {
        let caption = format!(
            "Strategies that know {} of the past, and equal shares. Equal ratios take equal room. The start is 100, all in the bank.",
            known(window)
        );
        page.figure(wealth(shown, window), &caption)
    });
    let performances = shown.report.strategies.iter().map(|figures| (figures.strategy.as_str(), &figures.performance));
    let page = page.table(performance_table(performances)).section("What was held");
    let page = windows().fold(page, |page, window| {
        let caption = format!("Share of wealth in all assets, of strategies that know {} of the past.", known(window));
        page.figure(totals(shown, window), &caption)
    });
    page.table(shares_table(shown)).section("How it was done").points(notes(shown))
}

fn noun(shown: &Shown) -> &'static str {
    shown.walked.backtest.record.frequency.noun()
}

fn method(shown: &Shown) -> String {
    let (choices, noun) = (&shown.report.choices, noun(shown));
    format!(
        "Each {noun} a strategy chooses shares of wealth in the assets, the rest in the bank, from the returns it knows: those \
         of the last years that its name says, or all. Nothing later than a {noun} is used for it. Robust is the best against the \
         worst law in a ball around the returns known, whose radius, at alpha {}, holds for all funds at once, is multiplied by \
         the scale and measured every {}; the norm says what moving a law costs. Static chooses as often and keeps its shares, \
         plug-in takes the returns known for the law. 1/N holds the same of every asset. Relative risk aversion {}.",
        choices.alpha,
        counted(choices.every, noun),
        choices.risk_aversion
    )
}

fn notes(shown: &Shown) -> Vec<String> {
    let (choices, noun) = (&shown.report.choices, noun(shown));
    vec![
        shown.read.clone(),
        format!("Seed {}; took {:.0} s.", choices.seed, shown.seconds),
        format!(
            "Every strategy takes the bank to pay what it paid in the {noun} before; accounts are credited with what it really \
             paid. What is held is brought to its shares every {noun}."
        ),
        intervals(&counted(shown.report.periods_per_year, noun)),
        "Equal shares at a strategy's own average total were chosen with hindsight; they are there to measure what choosing among \
         assets and times earned, not to be had."
            .into(),
        "The effective number of assets is the square of the sum of shares by the sum of their squares. Turnover is the share of \
         wealth that is bought and sold. Drawdown and final wealth belong to one path and carry no interval."
            .into(),
    ]
}

/// The strategies of a window and those that know nothing, as many as a chart holds.
fn drawn(shown: &Shown, window: Option<usize>) -> impl Iterator<Item = &AssetsLine> {
    let largest = shown.walked.lines.iter().filter_map(|line| line.strategy.rule.scale()).fold(0.0, f64::max);
    shown.walked.lines.iter().filter(move |line| match line.strategy.rule {
        Rule::Static { .. } => false,
        Rule::Robust { norm, scale } => {
            let is_shown = norm == Default::default() || scale == 0.0 || scale == largest;
            is_shown && line.strategy.window == window
        }
        Rule::Equal { .. } => true,
        _ => line.strategy.window == window,
    })
}

fn wealth(shown: &Shown, window: Option<usize>) -> Chart {
    let times = ends(&shown.times, shown.report.periods_per_year);
    let chart = Chart::new("Wealth", time(), Axis::new("wealth, logarithmic").log());
    drawn(shown, window).fold(chart, |chart, line| {
        chart.line(&line.name, times.iter().copied().zip(line.account.wealth.iter().copied()))
    })
}

fn totals(shown: &Shown, window: Option<usize>) -> Chart {
    let chart = Chart::new("In all assets", time(), Axis::new("share of wealth, %").from_zero());
    let chooses = |line: &&AssetsLine| matches!(line.strategy.rule, Rule::Robust { .. });
    drawn(shown, window).filter(chooses).fold(chart, |chart, line| {
        let shares = line.account.allocations.iter().map(|allocation| 100.0 * allocation);
        chart.line(&line.name, shown.times.iter().copied().zip(shares))
    })
}

fn rows(shown: &Shown, table: Table, of: impl Fn(&AssetsFigures) -> Vec<Cell>) -> Table {
    shown
        .report
        .strategies
        .iter()
        .fold(table, |table, figures| table.row([figures.strategy.as_str().into()].into_iter().chain(of(figures))))
}

fn utility_table(shown: &Shown) -> Table {
    let table = Table::new(
        "Certainty equivalents of a year from 100",
        &[
            "strategy",
            "certainty equivalent",
            "less 1/N",
            "less 1/N at its own mean total",
            "mean total, %",
            "effective assets",
        ],
    );
    let or_dash = |estimated: Option<BootstrapEstimate>| {
        estimated.map_or_else(|| number(f64::NAN, 2), |beyond| estimate(beyond, 1.0, 2))
    };
    rows(shown, table, |figures| {
        vec![
            estimate(figures.performance.yearly_certainty_equivalent, 1.0, 2),
            or_dash(figures.beyond_equal),
            or_dash(figures.performance.beyond_own_mix),
            number(100.0 * figures.performance.mean_allocation, 1),
            number(figures.effective_assets.unwrap_or(f64::NAN), 1),
        ]
    })
}

fn shares_table(shown: &Shown) -> Table {
    let assets = &shown.report.assets;
    let header: Vec<&str> = ["strategy"].into_iter().chain(assets.iter().map(String::as_str)).collect();
    rows(shown, Table::new("Mean share of wealth in each asset, %", &header), |figures| {
        assets.iter().map(|asset| number(100.0 * figures.mean_allocations[asset], 1)).collect()
    })
}
