//! Errors of the surrogates against direct solves, at states they were not trained on.
//!
//! Errors are in basis points, 1e-4 of log certainty equivalent. The truth at the last step is the robust step itself;
//! at the step before it is the robust step over the exact value of the last. Regret is the loss of an allocation
//! against the best one under the same worst-case criterion.

use std::error::Error;

use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::error::TrainError;
use ballast::control::policy::Policy;
use ballast::control::policy::advice::Advice;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::pool::{self, TrainingPool};
use ballast::control::problem::state::State;
use ballast::control::progress::Watch;
use ballast::control::request::contributions::Contributions;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::{
    FeatureMap, InitialLaws, Specification, SurrogateTarget, UtilitySpecification,
};
use ballast::control::solved_step::StepSolution;
use ballast::control::surrogate::design::Design;
use ballast::control::training::Training;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::statistics::summary::quantile;
use clap::Args;
use rand::RngExt;
use serde_json::json;

use crate::paper;

#[derive(Debug, Args)]
pub struct AccuracyBench {
    /// Design points per step, one row each
    #[arg(long, value_delimiter = ',', default_values_t = [1000])]
    counts: Vec<usize>,
    /// Accuracies in basis points, instead of numbers of points, one row each; the largest of --counts is then the most
    /// points
    #[arg(long, value_delimiter = ',')]
    accuracies: Vec<f64>,
    #[arg(long, default_value_t = 0.1)]
    alpha: f64,
    /// Returns of the history
    #[arg(long, default_value_t = 20)]
    sample_size: usize,
    #[arg(long, default_value_t = 10)]
    horizon: usize,
    /// Use power utility of this risk aversion instead of the paper's exponential one
    #[arg(long)]
    power: Option<f64>,
    /// Trading cost as a share of the amount traded; fresh states then hold any share
    #[arg(long, default_value_t = 0.0)]
    trading_cost: f64,
    /// Amount added at the end of each period, to a wealth of 100 at the start; withdrawn if negative
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    contribution: f64,
    /// Seed of the design and the surrogates; fresh states have their own
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Fresh states at the last step
    #[arg(long, default_value_t = 2000)]
    states: usize,
    /// Fresh states at the step before
    #[arg(long, default_value_t = 0)]
    nested_states: usize,
    /// Compare the surrogate targets and feature maps also
    #[arg(long)]
    variants: bool,
}

/// Seed of the fresh states, different from the design's.
const FRESH_SEED: u64 = 1_000_003;
pub(super) const BASIS_POINTS: f64 = 1e4;
/// Number of holdings at which the exact value is known if trading costs: four times as many as a surrogate has.
const EXACT_HOLDINGS: usize = 65;

/// A state with its direct solution.
struct Truth {
    state: State,
    floor_gain: f64,
}

pub fn run(bench: &AccuracyBench) -> Result<(), Box<dyn Error>> {
    let pool = TrainingPool::new(std::thread::available_parallelism().map_or(1, usize::from))?;
    pool.install(|| compare(bench)).map_err(Into::into)
}

fn compare(bench: &AccuracyBench) -> Result<(), TrainError> {
    let mut base = paper::specification(bench.sample_size, bench.horizon, 1000, InitialLaws::Resampled).completed()?;
    base.problem.radius = Some(RadiusRule::bridge(bench.alpha));
    base.problem.trading_cost = bench.trading_cost;
    base.problem.contributions = Contributions::Each(bench.contribution);
    base.seed = bench.seed;
    if let Some(risk_aversion) = bench.power {
        base.problem.utility = UtilitySpecification::Power { risk_aversion };
    }
    let base = base.completed()?;
    println!("paper's mixture, t0 = {}, T = {}, alpha = {}", bench.sample_size, bench.horizon, bench.alpha);
    let AccuracyBench { trading_cost, contribution, .. } = bench;
    println!("{}, trading cost {trading_cost}, {contribution} added each period", json!(base.problem.utility));
    let problem = Problem::new(&base);
    let last = bench.horizon - 1;
    let mut truths = vec![(last, last_truth(&problem, bench.states))];
    if bench.nested_states > 0 {
        truths.push((last - 1, nested_truth(&problem, bench.nested_states)));
    }
    heading();
    let most = bench.counts.iter().copied().max();
    let mut designs: Vec<(Option<usize>, Option<f64>)> =
        bench.accuracies.iter().map(|&accuracy| (most, Some(accuracy))).collect();
    if designs.is_empty() {
        designs = bench.counts.iter().map(|&count| (Some(count), None)).collect();
    }
    for (count, accuracy) in designs {
        let mut variants = vec![(SurrogateTarget::FloorGain, FeatureMap::Standardized)];
        if bench.variants {
            variants.push((SurrogateTarget::Value, FeatureMap::Standardized));
            variants.push((SurrogateTarget::FloorGain, FeatureMap::RawMoments));
        }
        for (target, features) in variants {
            let mut specification = base.clone();
            (specification.design.count, specification.design.accuracy) = (count, accuracy);
            specification.surrogate.target = target;
            specification.surrogate.features = features;
            let advisor = trained(&specification, truths.len())?;
            for (step, truths) in &truths {
                report(&problem, &advisor, *step, truths);
            }
        }
    }
    Ok(())
}

/// Draws states from the design's own law, with another seed.
fn fresh_states(specification: &Specification, step: usize, count: usize) -> Vec<State> {
    let mut fresh = specification.clone();
    fresh.seed = FRESH_SEED;
    fresh.design.count = Some(count);
    let design = Design::new(&fresh);
    let holding = |point| stream(FRESH_SEED, "fresh holding", step, point).random::<f64>();
    (0..count).map(|point| State { holding: holding(point), ..design.state(step, point) }).collect()
}

fn solved(problem: &Problem, step: usize, next: &NextValue, count: usize) -> Vec<Truth> {
    let states = fresh_states(&problem.specification, step, count);
    let solver = BellmanStep { problem, step, next };
    pool::map(states, |state: State| Truth { floor_gain: solver.solve(&state).floor_gain, state })
}

fn last_truth(problem: &Problem, count: usize) -> Vec<Truth> {
    solved(problem, problem.specification.problem.horizon - 1, &NextValue::Terminal, count)
}

/// Returns the value of the last step, solved anew at every requested state.
pub(super) fn exact_last_value(specification: &Specification) -> NextValue {
    let problem = Problem::new(specification);
    let step = specification.problem.horizon - 1;
    let holdings = problem.holdings(EXACT_HOLDINGS);
    let gains = move |state: &State| {
        let solver = BellmanStep { problem: &problem, step, next: &NextValue::Terminal };
        solver.solve_for_design(state, None, holdings).floor_gains
    };
    NextValue::Exact(holdings, Box::new(gains))
}

fn nested_truth(problem: &Problem, count: usize) -> Vec<Truth> {
    let next = exact_last_value(&problem.specification);
    solved(problem, problem.specification.problem.horizon - 2, &next, count)
}

/// Returns a policy whose last `steps` steps are solved. The steps before are never used and hold nothing.
fn trained(specification: &Specification, steps: usize) -> Result<Advisor, TrainError> {
    let training = Training::new(specification)?;
    let watch = Watch::unwatched();
    let mut solutions: Vec<StepSolution> = Vec::new();
    for step in (0..training.horizon()).rev() {
        let solution = if solutions.len() < steps {
            training.solve_step(step, solutions.last(), &watch)?
        } else {
            StepSolution::unsolved(step)
        };
        solutions.push(solution);
    }
    solutions.reverse();
    Ok(Advisor::new(Policy::new(specification.clone(), solutions)))
}

fn heading() {
    println!(
        "{:>5} {:<12} {:<13} {:>4}  {:>7}  {:^23}  {:^23}  {:>6}  {:>6}",
        "", "", "", "", "claimed", "value error", "regret as served", "in", "within"
    );
    println!(
        "{:>5} {:<12} {:<13} {:>4}  {:>7}  {:>7} {:>7} {:>7}  {:>7} {:>7} {:>7}  {:>6}  {:>6}",
        "N", "target", "features", "step", "RMS", "RMS", "99 %", "worst", "mean", "99 %", "worst", "design", "2 sd"
    );
}

fn report(problem: &Problem, advisor: &Advisor, step: usize, truths: &[Truth]) {
    let specification = advisor.specification();
    let diagnostics = &advisor.policy().steps()[step].diagnostics;
    let next = match step + 1 < specification.problem.horizon {
        true => exact_last_value(&problem.specification),
        false => NextValue::Terminal,
    };
    let solver = BellmanStep { problem, step, next: &next };
    let judged = pool::map(truths.iter().collect(), |truth: &Truth| judge(advisor, solver, truth));
    let inside: Vec<&Judged> = judged.iter().filter(|one| one.in_design).collect();
    let errors: Vec<f64> = inside.iter().map(|one| one.error.abs()).collect();
    let regrets: Vec<f64> = judged.iter().map(|one| one.regret).collect();
    let share = |part: usize| part as f64 / judged.len() as f64;
    let within = judged.iter().filter(|one| one.error.abs() <= BASIS_POINTS * 2.0 * one.deviation).count();
    let target = match specification.surrogate.target {
        SurrogateTarget::FloorGain => "floor_gain",
        SurrogateTarget::Value => "value",
    };
    let features = match specification.surrogate.features {
        FeatureMap::Standardized => "standardized",
        FeatureMap::RawMoments => "raw_moments",
    };
    println!(
        "{:>5} {target:<12} {features:<13} {step:>4}  {:>7}  {:>7.3} {:>7.3} {:>7.3}  {:>7.4} {:>7.3} {:>7.3}  {:>6.4}  {:>6.4}",
        diagnostics.design_count,
        diagnostics.expected_error.map_or_else(|| "-".to_owned(), |expected| format!("{:.3}", expected.total)),
        root_mean_square(&errors),
        quantile(&errors, 0.99),
        quantile(&errors, 1.0),
        regrets.iter().sum::<f64>() / regrets.len() as f64,
        quantile(&regrets, 0.99),
        quantile(&regrets, 1.0),
        share(inside.len()),
        share(within),
    );
}

/// The errors of an advice at one state.
struct Judged {
    /// Predicted minus true log certainty equivalent, in basis points.
    error: f64,
    /// Loss against the best allocation, in basis points, at least 0.
    regret: f64,
    /// Predicted standard deviation, in log certainty equivalent.
    deviation: f64,
    in_design: bool,
}

fn judge(advisor: &Advisor, solver: BellmanStep, truth: &Truth) -> Judged {
    let step = solver.step;
    let Advice { allocation, surrogate_sd, in_design, .. } = advisor.advise(step, &truth.state, AdviceMode::Surrogate);
    let served = solver.price(&truth.state, allocation).floor_gain;
    Judged {
        error: BASIS_POINTS * (advisor.surrogate(step, &truth.state).1 - truth.floor_gain),
        regret: BASIS_POINTS * (truth.floor_gain - served).max(0.0),
        deviation: surrogate_sd,
        in_design,
    }
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}
