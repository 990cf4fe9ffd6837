//! `ballast-lab reproduce`: computes the paper's section 3 anew, and shows every printed figure next to it.

use std::error::Error;
use std::path::{Path, PathBuf};

use ballast::http::site::dashboard;
use ballast::numerics::statistics::summary::Estimate;
use ballast::report::{self, Csv};
use clap::Args;
use serde::Serialize;

use super::compare::ComparisonRun;
use super::evaluate::write;
use super::tables;

mod findings;
mod first_guess;
mod printed;
mod radius;
mod requests;
mod runs;

#[derive(Debug, Clone, Args)]
pub struct Reproduce {
    /// Folder for reproduction.html, reproduction.json and the CSV files, created if absent
    #[arg(long)]
    out: PathBuf,
    /// Run a small version that shows that everything works: tiny designs, few histories; too little for a verdict on
    /// the paper
    #[arg(long)]
    quick: bool,
}

/// The sizes of the computation.
#[derive(Debug, Clone, Serialize)]
pub struct ReproductionPlan {
    pub horizon: usize,
    /// Design points of the learning framework and, up to the paper's 200, of the known law.
    pub count: usize,
    /// Design points of a framework frozen at its history, where wealth is the only input.
    pub ladder: usize,
    /// Simulated bridges behind a quantile.
    pub bridges: usize,
    pub histories: usize,
    pub paths: usize,
    /// Histories simulated for each of the paper's two cases.
    pub close_histories: usize,
    /// Most histories drawn in search of them.
    pub most_drawn: usize,
    pub study_sizes: Vec<usize>,
    pub study_count: usize,
    pub study_histories: usize,
    pub study_paths: usize,
    /// Lengths of history and horizons at which histories with a small Q are compared with average ones.
    pub change_sizes: Vec<usize>,
    pub change_horizons: Vec<usize>,
    /// Histories drawn to find them.
    pub change_drawn: usize,
    /// Lengths of history and horizons after a wrong first guess.
    pub guess_sizes: Vec<usize>,
    pub guess_horizons: Vec<usize>,
    /// Design points and bridges where several horizons are compared.
    pub long_count: usize,
    pub long_ladder: usize,
    pub long_bridges: usize,
}

impl ReproductionPlan {
    fn full() -> Self {
        ReproductionPlan {
            horizon: 10,
            count: 1000,
            ladder: 40,
            bridges: 2000,
            histories: 100,
            paths: 500,
            close_histories: 40,
            most_drawn: 200_000,
            study_sizes: vec![20, 80, 320, 1280],
            study_count: 300,
            study_histories: 40,
            study_paths: 100,
            change_sizes: vec![20, 80],
            change_horizons: vec![10, 40],
            change_drawn: 4000,
            guess_sizes: vec![20, 60],
            guess_horizons: vec![5, 10, 20, 40],
            long_count: 100,
            long_ladder: 12,
            long_bridges: 500,
        }
    }

    fn quick() -> Self {
        ReproductionPlan {
            count: 40,
            bridges: 200,
            histories: 10,
            paths: 100,
            close_histories: 3,
            most_drawn: 20_000,
            study_sizes: vec![20, 80],
            study_count: 30,
            ladder: 20,
            study_histories: 4,
            change_horizons: vec![5, 10],
            change_drawn: 100,
            guess_horizons: vec![5, 10],
            long_count: 30,
            long_bridges: 200,
            ..ReproductionPlan::full()
        }
    }

    /// Returns true if the run is large enough that differences from the paper exceed chance and the error of coarse
    /// designs.
    fn decides(&self) -> bool {
        let sizes = |plan: &ReproductionPlan| {
            [plan.count, plan.bridges, plan.histories, plan.close_histories, plan.study_histories, plan.long_count]
        };
        sizes(self).iter().zip(sizes(&ReproductionPlan::full())).all(|(own, least)| *own >= least)
    }
}

/// All results.
#[derive(Debug, Serialize)]
struct Reproduction {
    plan: ReproductionPlan,
    seconds: f64,
    findings: Vec<findings::Finding>,
    section: runs::Section,
    study: runs::Study,
    changes: Vec<radius::ChangeRow>,
    guesses: Vec<first_guess::GuessRow>,
}

pub fn run(arguments: &Reproduce) -> Result<(), Box<dyn Error>> {
    let plan = if arguments.quick { ReproductionPlan::quick() } else { ReproductionPlan::full() };
    std::fs::create_dir_all(&arguments.out)?;
    let workshop = ComparisonRun::new()?;
    let section = runs::section(&plan, &workshop)?;
    let study = runs::study(&plan, &workshop)?;
    let changes = radius::changes(&plan, &workshop)?;
    let guesses = first_guess::study(&plan, &workshop)?;
    workshop.finish();
    let findings = Vec::new();
    let mut whole = Reproduction { seconds: workshop.seconds(), plan, findings, section, study, changes, guesses };
    whole.findings = findings::all(&whole);
    let html = page(&whole, arguments.quick)?;
    write(&arguments.out, "reproduction.html", &html)?;
    write(&arguments.out, "reproduction.json", &serde_json::to_string_pretty(&whole)?)?;
    write_tables(&arguments.out, &whole)?;
    for finding in &whole.findings {
        println!("{finding}");
    }
    println!("\n{} (done in {:.0} s)", arguments.out.join("reproduction.html").display(), whole.seconds);
    Ok(())
}

/// All results, and the additions of the page.
#[derive(Serialize)]
struct ReproductionPage<'a> {
    #[serde(flatten)]
    whole: &'a Reproduction,
    quick: bool,
    sample_size: usize,
    printed: &'a [printed::PrintedTable],
}

fn page(whole: &Reproduction, quick: bool) -> Result<String, report::FileError> {
    let shown = ReproductionPage { whole, quick, sample_size: requests::SAMPLE_SIZE, printed: &printed::TABLES };
    let sentences: Vec<String> = whole.findings.iter().map(ToString::to_string).collect();
    let title = "Nonparametric adaptive robust control: section 3 anew";
    report::html(dashboard::embedded, "reproduction.js", title, &shown, &sentences)
}

fn write_tables(folder: &Path, whole: &Reproduction) -> Result<(), String> {
    write(folder, "strategies.csv", &tables::csv(&whole.section.all))?;
    write(folder, "periods.csv", &tables::periods_csv(&whole.section.all))?;
    let mut csv = Csv::new(&["table", "strategy", "statistic", "paper", "value", "low", "high"]);
    for (index, (case, table)) in whole.section.cases.iter().zip(&printed::TABLES).enumerate() {
        for strategy in case.report.iter().flat_map(|report| &report.strategies) {
            if strategy.framework.is_none() {
                continue;
            }
            // A framework without a printed column has its figures beside empty ones.
            let column = table.column(strategy.framework).unwrap_or(&[f64::NAN; 6]);
            let ours = tables::estimates(strategy);
            for (name, paper) in printed::STATISTICS.iter().zip(column) {
                let Some((_, Estimate { value, low, high })) = ours.iter().find(|(own, _)| own == name) else {
                    continue;
                };
                let figures = [*paper, *value, *low, *high].map(tables::shown);
                csv.row(
                    [format!("{}", index + 1), strategy.strategy.clone(), (*name).to_owned()]
                        .into_iter()
                        .chain(figures),
                );
            }
        }
    }
    write(folder, "tables.csv", &csv.into_text())?;
    let mut csv = Csv::new(&["quantile"]);
    whole.section.quantiles.shown.iter().for_each(|quantile| csv.row([quantile]));
    write(folder, "quantiles.csv", &csv.into_text())?;
    let mut csv = Csv::new(&["sample_size", "framework", "radius", "gap", "value", "low", "high"]);
    for row in &whole.study.rows {
        for (name, Estimate { value, low, high }) in [("value", row.value_gap), ("realised", row.realised_gap)] {
            let framework = row.framework.name().to_owned();
            let names = [row.sample_size.to_string(), framework, row.radius.to_string(), name.to_owned()];
            csv.row(names.into_iter().chain([value, low, high].map(|figure| figure.to_string())));
        }
    }
    write(folder, "convergence.csv", &csv.into_text())?;
    write(folder, "smaller_radius.csv", &radius::shrunk_csv(&whole.section.shrunk))?;
    write(folder, "larger.csv", &radius::changes_csv(&whole.changes))?;
    write(folder, "first_guess.csv", &first_guess::csv(&whole.guesses))?;
    write(folder, "first_guess_periods.csv", &first_guess::periods_csv(&whole.guesses))
}
