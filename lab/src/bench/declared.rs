//! The duration of declared problems: each of `examples/problems` as its file says, and the investor declared in formulas
//! beside its own solver.

use std::error::Error;

use ballast::control::error::TrainError;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::policy::declared::Decided;
use ballast::control::pool::TrainingPool;
use ballast::control::problem::state::State;
use ballast::control::progress::Watch;
use ballast::control::request::declared::DeclaredSpecification;
use ballast::control::request::specification::Specification;
use ballast::control::training::Training;
use clap::Args;
use serde_json::{Value, json};

use super::accuracy::BASIS_POINTS;
use super::summary::timed;

#[derive(Debug, Args)]
pub struct DeclaredBench {
    /// Design points per step of the investor
    #[arg(long, default_value_t = 1000)]
    count: usize,
    /// Periods of the investor
    #[arg(long, default_value_t = 10)]
    horizon: usize,
    #[arg(long, default_value_t = 3)]
    runs: usize,
}

const INVESTOR: &str = include_str!("../../../examples/problems/investor.json");
/// The other examples, by name.
const OTHERS: [(&str, &str); 7] = [
    ("stock", include_str!("../../../examples/problems/stock.json")),
    ("store", include_str!("../../../examples/problems/store.json")),
    ("goal", include_str!("../../../examples/problems/goal.json")),
    ("hedge", include_str!("../../../examples/problems/hedge.json")),
    ("spending", include_str!("../../../examples/problems/spending.json")),
    ("liquidation", include_str!("../../../examples/problems/liquidation.json")),
    ("regulator", include_str!("../../../examples/problems/regulator.json")),
];

pub fn run(bench: &DeclaredBench) -> Result<(), Box<dyn Error>> {
    let pool = TrainingPool::new(std::thread::available_parallelism().map_or(1, usize::from))?;
    println!("{:<12}{:>6}{:>8}{:>10}  first actions", "problem", "T", "states", "seconds");
    for (name, text) in OTHERS.into_iter().chain([("investor", INVESTOR)]) {
        let declared: DeclaredSpecification = serde_json::from_str(text)?;
        let (seconds, advice) = timed_result(bench.runs, || pool.install(|| solved(&declared)))?;
        let actions: Vec<String> = advice.actions.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
        let (horizon, count) = (declared.problem.horizon, declared.design.count.unwrap_or_default());
        println!("{name:<12}{horizon:>6}{count:>8}{seconds:>10.2}  {}", actions.join(", "));
    }
    beside_the_investor(bench, &pool)
}

fn beside_the_investor(bench: &DeclaredBench, pool: &TrainingPool) -> Result<(), Box<dyn Error>> {
    let mut text: Value = serde_json::from_str(INVESTOR)?;
    text["problem"]["horizon"] = json!(bench.horizon);
    // As far as wealth can grow.
    let best = text["problem"]["noise"]["high"].as_f64().unwrap_or_default();
    let wealth = &mut text["problem"]["states"]["wealth"];
    let start = wealth["start"].as_f64().unwrap_or_default();
    wealth["low"] = json!(start * (-2.0 * best * bench.horizon as f64).exp());
    wealth["high"] = json!(start * (2.0 * best * bench.horizon as f64).exp());
    text["design"]["count"] = json!(bench.count);
    let declared: DeclaredSpecification = serde_json::from_value(text.clone())?;
    let problem = &text["problem"];
    let own: Specification = serde_json::from_value(json!({ "problem": {
        "history": problem["history"], "horizon": bench.horizon, "rate_per_step": problem["parameters"]["rate"],
        "utility": { "kind": "power", "risk_aversion": problem["utility"]["risk_aversion"] },
        "support": { "rule": "between", "min": problem["noise"]["low"], "max": problem["noise"]["high"] },
        "radius": problem["radius"] },
        "design": { "count": bench.count } }))?;
    let (in_formulas, advice) = timed_result(bench.runs, || pool.install(|| solved(&declared)))?;
    let (by_its_own, investor) = timed_result(bench.runs, || {
        let training = Training::new(&own)?;
        Ok(Advisor::new(pool.install(|| training.run(&Watch::unwatched()))?))
    })?;
    let state = State::new(&own.problem.history, 100.0, own.problem.learning)?;
    let found = investor.advise(0, &state, AdviceMode::Resolve);
    println!("\nthe investor over {} periods, {} states a step", bench.horizon, bench.count);
    println!(
        "  in formulas {in_formulas:.2} s, by its own solver {by_its_own:.2} s: {:.1} times",
        in_formulas / by_its_own
    );
    let off = BASIS_POINTS * (advice.value / found.certainty_equivalent).ln();
    let share = advice.actions.values().next().copied().unwrap_or_default();
    println!("  apart by {off:+.4} bp and {:+.5} of the allocation", share - found.allocation);
    Ok(())
}

fn solved(declared: &DeclaredSpecification) -> Result<Decided, TrainError> {
    Decided::first(declared, &Watch::unwatched())
}

/// Returns the median of some runs in seconds, and what the last one found.
fn timed_result<T>(runs: usize, work: impl Fn() -> Result<T, TrainError>) -> Result<(f64, T), Box<dyn Error>> {
    let mut found = None;
    let seconds = timed(runs, || found = Some(work()));
    Ok((seconds, found.ok_or("no run")??))
}
