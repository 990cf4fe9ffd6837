//! `ballast-lab bench assets`: the robust step of several assets, from a cold start and from a warm start at the solution
//! of the month before: on windows of twelve US industries, on random tables, and on steps drawn from all that may be
//! asked.

mod hostile;
mod random;
mod tables;

use std::error::Error;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use ballast::control::assets::AssetsSolution;
use ballast::control::problem::compositions::{CompositionSet, GroupRange};
use ballast::control::request::support::Support;
use clap::Args;
use serde::Serialize;

use self::tables::ordinary_step;
use super::summary::median;

#[derive(Debug, Clone, Args)]
pub struct AssetsBench {
    /// CSV file of simple returns: dates, assets, and the bank in the last column
    #[arg(long, default_value = "data/us_industries_monthly.csv")]
    file: PathBuf,
    #[arg(long, value_delimiter = ',', default_values_t = [2, 5, 12])]
    assets: Vec<usize>,
    /// Months of a window
    #[arg(long, value_delimiter = ',', default_values_t = [60, 240])]
    months: Vec<usize>,
    /// Windows, each a month after the one before, the last at the end of the file
    #[arg(long, default_value_t = 60)]
    windows: usize,
    /// Radius in units of the assets' mean deviation over the root of the months; the default is about half of that for all
    /// funds at once
    #[arg(long, default_value_t = 1.3)]
    radius: f64,
    /// Limit the share of each asset in the composition to this, and that of the first half of the assets to a half
    #[arg(long, value_name = "SHARE")]
    most: Option<f64>,
    /// Print a line of JSON for each row, with the last window's answer
    #[arg(long)]
    json: bool,
    /// Time random tables of several sizes instead, so many of each size
    #[arg(long, value_name = "TABLES", num_args = 0..=1, default_missing_value = "50", conflicts_with = "hostile")]
    random: Option<NonZeroUsize>,
    /// Solve so many steps drawn from all that may be asked instead, and print those that are not certified
    #[arg(long, value_name = "STEPS", num_args = 0..=1, default_missing_value = "10000")]
    hostile: Option<NonZeroUsize>,
    /// Number of the first hostile step
    #[arg(long, default_value_t = 0, requires = "hostile")]
    first: usize,
}

/// Risk aversion in wealth.
pub const RISK_AVERSION: f64 = 3.0;
/// Interest rate per month, about the average of bills.
pub const RATE: f64 = 0.003;

/// The measurements over the windows.
#[derive(Debug, Serialize)]
struct WindowFindings {
    ground_norm: &'static str,
    assets: usize,
    months: usize,
    rate: f64,
    risk_aversion: f64,
    /// Median seconds.
    cold: f64,
    warm: f64,
    /// Number of points at which the adversary's problem was solved, on average over windows.
    evaluations: f64,
    /// The widest gap between a value and its bound, in basis points.
    gap: f64,
    /// Radius and solution of the last window.
    radius: f64,
    allocation: Vec<f64>,
    value: f64,
}

pub fn run(bench: &AssetsBench) -> Result<(), Box<dyn Error>> {
    if let Some(tables) = bench.random {
        return random::run(tables.get());
    }
    if let Some(steps) = bench.hostile {
        return hostile::run(bench.first..bench.first.saturating_add(steps.get()));
    }
    let rows = read(&bench.file)?;
    if !bench.json {
        println!(
            "{:<12}{:>8}{:>8}{:>12}{:>12}{:>16}",
            "norm", "assets", "months", "cold, ms", "warm, ms", "widest gap, bp"
        );
    }
    for sup in [false, true] {
        for &assets in &bench.assets {
            for &months in &bench.months {
                let found = measure(bench, &rows, sup, assets, months)?;
                if bench.json {
                    println!("{}", serde_json::to_string(&found)?);
                    continue;
                }
                let WindowFindings { ground_norm, cold, warm, gap, .. } = found;
                println!("{ground_norm:<12}{assets:>8}{months:>8}{:>12.2}{:>12.2}{gap:>16.4}", 1e3 * cold, 1e3 * warm);
            }
        }
    }
    Ok(())
}

/// Reads log-returns, month by month.
pub fn read(file: &Path) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(file)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let returns = record.iter().skip(1).take(record.len().saturating_sub(2)).map(str::parse::<f64>);
        rows.push(returns.map(|value| value.map(f64::ln_1p)).collect::<Result<Vec<f64>, _>>()?);
    }
    Ok(rows)
}

fn measure(
    bench: &AssetsBench,
    rows: &[Vec<f64>],
    sup: bool,
    assets: usize,
    months: usize,
) -> Result<WindowFindings, Box<dyn Error>> {
    let columns = rows.first().map_or(0, Vec::len);
    if assets == 0 || assets > columns || months < 2 || bench.windows == 0 || rows.len() + 1 < months + bench.windows {
        let found = format!("{assets} assets, {months} months and {} windows", bench.windows);
        return Err(format!(
            "{found}: the file has {columns} assets and {} months, and a window two months at least",
            rows.len()
        )
        .into());
    }
    let rows: Vec<Vec<f64>> = rows.iter().map(|row| row[..assets].to_vec()).collect();
    let (mut cold, mut warm, mut widest): (Vec<f64>, Vec<f64>, f64) = (Vec::new(), Vec::new(), 0.0);
    let mut evaluations = 0.0;
    let mut last: Option<(AssetsSolution, f64)> = None;
    for end in rows.len() + 1 - bench.windows..=rows.len() {
        let window = &rows[end - months..end];
        let (step, radius) = ordinary_step(window, sup, Support::None {}, bench.radius);
        let step = step.within(bench.most.map(|most| limits(assets, most)));
        let started = Instant::now();
        let found = step.solve(None);
        cold.push(started.elapsed().as_secs_f64());
        let started = Instant::now();
        let near = last.as_ref().map(|(near, _)| step.solve(Some(near)));
        warm.extend(near.as_ref().map(|_| started.elapsed().as_secs_f64()));
        for solution in near.iter().chain([&found]) {
            widest = widest.max(gap(solution));
        }
        evaluations += found.evaluations as f64 / bench.windows as f64;
        last = Some((found, radius));
    }
    let Some((AssetsSolution { allocation, value, .. }, radius)) = last else { return Err("no window".into()) };
    Ok(WindowFindings {
        ground_norm: norm_name(sup),
        assets,
        months,
        rate: RATE,
        risk_aversion: RISK_AVERSION,
        cold: median(&cold),
        warm: median(&warm),
        evaluations,
        gap: widest,
        radius,
        allocation,
        value,
    })
}

/// Returns the compositions with a greatest share of each asset, and at most half in the first half of the assets.
fn limits(assets: usize, most: f64) -> CompositionSet {
    let members = (0..assets / 2).collect();
    CompositionSet::new(vec![[0.0, most]; assets], vec![GroupRange { members, least: 0.0, most: 0.5 }])
}

/// Returns the gap between a value and its bound, in basis points.
fn gap(solution: &AssetsSolution) -> f64 {
    1e4 * (solution.bound - solution.value)
}

fn norm_name(sup: bool) -> &'static str {
    if sup { "sup" } else { "scaled_one" }
}
