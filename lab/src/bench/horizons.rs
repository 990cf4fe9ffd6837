//! Errors of a trained policy against brute force, given one history: value and allocation at the start.
//!
//! Over two steps the truth is the robust step over the exact value of the last, solved anew at every state. Over three
//! it is read from a file of references, computed elsewhere by nested grids in plain Python.

use std::error::Error;
use std::path::PathBuf;

use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::problem::Problem;
use ballast::control::error::TrainError;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::pool::TrainingPool;
use ballast::control::problem::state::State;
use ballast::control::progress::Watch;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::{InitialLaws, Specification, UtilitySpecification};
use ballast::control::training::Training;
use clap::Args;
use serde_json::{Value, json};

use super::accuracy::{BASIS_POINTS, exact_last_value};
use crate::paper;

#[derive(Debug, Args)]
pub struct HorizonsBench {
    /// Design points per step
    #[arg(long, default_value_t = 1000)]
    count: usize,
    /// Histories drawn from the paper's mixture, over two steps
    #[arg(long, default_value_t = 20)]
    draws: u64,
    /// References over more steps: `cases` of `history`, `horizon`, `radius_times_sqrt_sample_size`, `utility`,
    /// `risk_aversion`, `wealth`, `rate_per_step`, `allocation`, `log_certainty_equivalent_over_bank`
    #[arg(long)]
    references: Option<PathBuf>,
}

/// Radii of the drawn histories, in turn, times the square root of the sample size: from hardly any doubt to mostly
/// all-bank.
const KAPPAS: [f64; 5] = [0.0, 0.02, 0.05, 0.1, 0.15];
const SAMPLE_SIZE: usize = 20;

/// The result at the start: log certainty equivalent over all-bank, and the allocation.
struct StartResult {
    gain: f64,
    allocation: f64,
}

pub fn run(bench: &HorizonsBench) -> Result<(), Box<dyn Error>> {
    let pool = TrainingPool::new(std::thread::available_parallelism().map_or(1, usize::from))?;
    println!(
        "{:>7} {:>2} {:>6}  {:>9} {:>9}  {:>10} {:>7}",
        "history", "T", "kappa", "gain bp", "error bp", "allocation", "error"
    );
    let mut worst: [f64; 2] = [0.0; 2];
    let mut row = |name: &str, horizon: usize, kappa: f64, found: &StartResult, truth: &StartResult| {
        let errors = [BASIS_POINTS * (found.gain - truth.gain), found.allocation - truth.allocation];
        println!(
            "{name:>7} {horizon:>2} {kappa:>6}  {:>9.3} {:>9.3}  {:>10.4} {:>7.4}",
            BASIS_POINTS * truth.gain,
            errors[0],
            truth.allocation,
            errors[1]
        );
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error.abs());
        }
    };
    for draw in 0..bench.draws {
        let kappa = KAPPAS[draw as usize % KAPPAS.len()];
        let mut specification = paper::specification(SAMPLE_SIZE, 2, bench.count, InitialLaws::Given);
        specification.problem.history = paper::history(SAMPLE_SIZE, draw + 2);
        specification.problem.radius = Some(RadiusRule::RootN { kappa });
        // If the paper's investor holds all or nothing, a more averse one holds something in between.
        let risk_aversion = if draw % 2 == 0 { 0.01 } else { 0.05 };
        specification.problem.utility = UtilitySpecification::exponential(risk_aversion);
        let specification = specification.completed()?;
        let found = pool.install(|| trained(&specification))?;
        let truth = pool.install(|| nested(&specification))?;
        row(&draw.to_string(), 2, kappa, &found, &truth);
    }
    let references: Value = match &bench.references {
        Some(path) => serde_json::from_slice(&std::fs::read(path)?)?,
        None => json!({ "cases": [] }),
    };
    for case in references["cases"].as_array().into_iter().flatten() {
        let Some(kappa) = case["radius_times_sqrt_sample_size"].as_f64() else { continue };
        let specification = specification_of(case, bench.count)?;
        let truth = StartResult {
            gain: number(case, "log_certainty_equivalent_over_bank")?,
            allocation: number(case, "allocation")?,
        };
        let found = pool.install(|| trained(&specification))?;
        row("file", specification.problem.horizon, kappa, &found, &truth);
    }
    println!("worst: {:.3} bp, allocation {:.4}", worst[0], worst[1]);
    Ok(())
}

fn trained(specification: &Specification) -> Result<StartResult, TrainError> {
    let watch = Watch::unwatched();
    let advisor = Advisor::new(Training::new(specification)?.run(&watch)?);
    let advice = advisor.advise(0, &advisor.initial_state(None, None)?, AdviceMode::Surrogate);
    Ok(StartResult { gain: (advice.certainty_equivalent / advice.floor).ln(), allocation: advice.allocation })
}

/// Solves the first of two steps by brute force.
fn nested(specification: &Specification) -> Result<StartResult, TrainError> {
    let problem = &specification.problem;
    let state = State::new(&problem.history, problem.initial_wealth, problem.learning)?;
    let next = exact_last_value(specification);
    let solution = BellmanStep { problem: &Problem::new(specification), step: 0, next: &next }.solve(&state);
    Ok(StartResult { gain: solution.floor_gain, allocation: solution.action })
}

fn number(case: &Value, field: &str) -> Result<f64, Box<dyn Error>> {
    case[field].as_f64().ok_or_else(|| format!("{field} of a case is {}, not a number", case[field]).into())
}

fn specification_of(case: &Value, count: usize) -> Result<Specification, Box<dyn Error>> {
    let specification: Specification = serde_json::from_value(json!({
        "problem": {
            "horizon": case["horizon"], "rate_per_step": case["rate_per_step"], "initial_wealth": case["wealth"],
            "utility": { "kind": case["utility"], "risk_aversion": case["risk_aversion"] },
            "radius": { "rule": "root_n", "kappa": case["radius_times_sqrt_sample_size"] },
            "history": case["history"],
        },
        "design": { "count": count },
    }))?;
    Ok(specification.completed()?)
}
