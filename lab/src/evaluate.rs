//! `ballast-lab evaluate`: a comparison of frameworks without a server.

use std::error::Error;
use std::path::{Path, PathBuf};

use ballast::control::error::FieldError;
use ballast::control::evaluation::paths::Evaluation;
use ballast::control::request::evaluation::EvaluationRequest;
use ballast::http::gate::decode;
use ballast::http::site::dashboard;
use ballast::report;
use clap::Args;
use serde_json::json;

use super::compare::ComparisonRun;
use super::{paper, tables};

#[derive(Debug, Clone, Args)]
pub struct Evaluate {
    /// The request, as for POST /evaluate; the paper's problem unless given
    file: Option<PathBuf>,
    /// Folder for report.html, report.json, strategies.csv and periods.csv, created if absent
    #[arg(long)]
    out: PathBuf,
}

/// Returns of the history, and steps, if no request is given: the paper's t0 and T.
const SAMPLE_SIZE: usize = 20;
const HORIZON: usize = 10;

pub fn run(arguments: &Evaluate) -> Result<(), Box<dyn Error>> {
    let request = match &arguments.file {
        Some(file) => read(file)?,
        None => serde_json::from_value(json!({
            "problem": paper::problem(SAMPLE_SIZE, HORIZON), "design": { "sampling_law": paper::mixture() } }))?,
    };
    if let Some(policy) = request.policies.values().next() {
        return Err(FieldError::new("policies", policy, "must be left out: only a service keeps policies").into());
    }
    let workshop = ComparisonRun::new()?;
    let evaluation = Evaluation::new(request)?;
    for warning in evaluation.request.problem.warnings() {
        eprintln!("{}", warning.message);
    }
    let followers = workshop.train(&evaluation)?;
    let (_, report) = workshop.compare("simulating", &evaluation, &followers, workshop.seconds())?;
    workshop.finish();
    std::fs::create_dir_all(&arguments.out)?;
    let title =
        format!("{} strategies on {} futures", report.strategies.len(), report.request.paths * report.histories.len());
    let page = report::html(dashboard::embedded, "evaluation.js", &title, &report, &report.sentences)?;
    write(&arguments.out, "report.html", &page)?;
    write(&arguments.out, "report.json", &serde_json::to_string_pretty(&report)?)?;
    write(&arguments.out, "strategies.csv", &tables::csv(&report))?;
    write(&arguments.out, "periods.csv", &tables::periods_csv(&report))?;
    print!("{}", tables::screen(&report));
    let costs = report.costs;
    println!("\nTrained in {:.1} s, simulated in {:.1} s.", costs.training_seconds, costs.simulation_seconds);
    if let Some(seconds) = costs.resolve_seconds {
        println!("A step outside the design took {:.1} ms to solve anew.", 1e3 * seconds);
    }
    Ok(())
}

fn read(file: &Path) -> Result<EvaluationRequest, Box<dyn Error>> {
    let text = std::fs::read(file).map_err(|error| format!("reading {}: {error}", file.display()))?;
    Ok(decode::json(&text).map_err(|problem| format!("{}: {}", file.display(), problem.detail))?)
}

/// Writes one file of the result.
pub fn write(folder: &Path, name: &str, text: &str) -> Result<(), String> {
    let path = folder.join(name);
    std::fs::write(&path, text).map_err(|error| format!("writing {}: {error}", path.display()))
}
