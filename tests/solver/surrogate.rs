//! The surrogates at states that they were not trained on: how far off they are, whether they know it, and whether they say
//! where they were never trained. `ballast-lab bench accuracy` asks the same of designs of the size that is served.

use std::sync::LazyLock;

use crate::support::policies::{advisor, specification};
use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::policy::advice::AdviceSource;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::state::State;
use ballast::control::surrogate::design::Design;
use serde_json::{Value, json};

const BASIS_POINTS: f64 = 1e4;
/// Seed of the fresh states, another than that of the design.
const FRESH_SEED: u64 = 1_000_003;
/// Fresh states of the last step, and of the step before, whose truth takes hundreds of solves each.
const LAST: usize = 400;
const BEFORE: usize = 12;

/// The paper's mixture over two periods, after 20 returns of its own, at a radius where some states are all in, some all
/// out, and most between.
fn request(seed: u64, count: usize) -> Value {
    let history: Vec<f64> = (0..20).map(|k| 0.011 + 0.1 * f64::from(7 * k % 20 - 10) / 10.0).collect();
    json!({
        "problem": { "horizon": 2, "rate_per_step": 0.002, "history": history, "utility": { "kind": "exponential", "risk_aversion": 0.01 },
            "radius": { "rule": "bridge", "alpha": 0.5, "scale": 0.3 } },
        "design": { "count": count, "initial_laws": "resampled", "sampling_law": { "kind": "gaussian_mixture",
            "components": [ { "weight": 0.4, "mean": 0.006, "variance": 0.016 },
                            { "weight": 0.6, "mean": 0.016, "variance": 0.00625 } ] } },
        "seed": seed
    })
}

fn fresh_states(step: usize, count: usize) -> Vec<State> {
    let design = Design::new(&specification(request(FRESH_SEED, count)));
    (0..count).map(|index| design.state(step, index)).collect()
}

static TRAINED: LazyLock<Advisor> = LazyLock::new(|| advisor(request(1, 250)));

/// The error of an advice at a fresh state, in basis points.
struct Judged {
    error: f64,
    regret: f64,
    deviation: f64,
    in_design: bool,
}

/// Against the robust step itself, over the exact value of the step after.
fn judged(step: usize, count: usize) -> Vec<Judged> {
    let problem = Problem::new(TRAINED.specification());
    let next = match step {
        1 => NextValue::Terminal,
        _ => {
            let last = Problem::new(TRAINED.specification());
            NextValue::Exact(
                problem.holdings(1),
                Box::new(move |state: &State| {
                    vec![BellmanStep { problem: &last, step: 1, next: &NextValue::Terminal }.solve(state).floor_gain]
                }),
            )
        }
    };
    let solver = BellmanStep { problem: &problem, step, next: &next };
    let judge = |state: &State| {
        let truth = solver.solve(state).floor_gain;
        let advice = TRAINED.advise(step, state, AdviceMode::Surrogate);
        Judged {
            error: BASIS_POINTS * (TRAINED.surrogate(step, state).1 - truth),
            regret: BASIS_POINTS * (truth - solver.price(state, advice.allocation).floor_gain),
            deviation: BASIS_POINTS * advice.surrogate_sd,
            in_design: advice.in_design,
        }
    };
    fresh_states(step, count).iter().map(judge).collect()
}

static AT_THE_LAST_STEP: LazyLock<Vec<Judged>> = LazyLock::new(|| judged(1, LAST));

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn error_and_regret(judged: &[Judged]) -> (f64, f64) {
    let inside = judged.iter().filter(|one| one.in_design);
    (root_mean_square(inside.map(|one| one.error)), mean(judged.iter().map(|one| one.regret)))
}

#[test]
fn values_are_close_and_allocations_cost_next_to_nothing_at_fresh_states() {
    let (error, regret) = error_and_regret(&AT_THE_LAST_STEP);
    println!("last step: error {error:.3} bp, mean regret {regret:.4} bp");
    // A design of 150 points leaves 0.37 and 0.034 (one of 1,000 a fifth of that): twice as much is a loss of accuracy.
    assert!(error < 0.75, "{error}");
    assert!((0.0..0.07).contains(&regret), "{regret}");
    let (error, regret) = error_and_regret(&judged(0, BEFORE));
    println!("step before: error {error:.3} bp, mean regret {regret:.4} bp");
    // 0.34 and 0.002, of a dozen states: again twice as much, and what few states add.
    assert!(error < 0.75, "{error}");
    assert!((-1e-3..0.02).contains(&regret), "{regret}");
}

#[test]
fn two_predicted_deviations_hold_the_truth_about_as_often_as_a_normal_law_would() {
    let judged = &*AT_THE_LAST_STEP;
    let within = mean(judged.iter().map(|one| f64::from(one.error.abs() <= 2.0 * one.deviation)));
    let size = root_mean_square(judged.iter().map(|one| one.error / one.deviation));
    println!("{within} within two deviations; errors are {size} deviations");
    // 95.4 % under a normal law, which 400 states tell to 1 %: two of those below, and above what larger designs reach.
    assert!((0.93..=0.985).contains(&within), "{within}");
    // Deviations of the right size on the whole, and neither half nor twice the errors.
    assert!((0.6..1.4).contains(&size), "{size}");
}

#[test]
fn the_guard_passes_the_share_of_fresh_states_that_it_was_set_for() {
    const STATES: usize = 1000;
    for step in [0, 1] {
        let passes = |state: &State| TRAINED.advise_from_surrogate(step, state, TRAINED.radius(state)).is_ok();
        let outside = fresh_states(step, STATES).iter().filter(|state| !passes(state)).count();
        println!("step {step}: {outside} of {STATES} outside");
        // 0.5 % of them, where the limit is itself the quantile of 1,000 others: 5, give or take five deviations of
        // sqrt(1000 0.005 0.995 (1 + 1)) = 3.2; and some, or the guard guards nothing.
        assert!((1..=21).contains(&outside), "step {step}: {outside} of {STATES}");
    }
}

#[test]
fn a_law_like_none_of_the_design_is_told_apart_and_solved_anew() {
    let own = TRAINED.specification().problem.history.clone();
    let far: Vec<Vec<f64>> = vec![
        own.iter().map(|z| z + 0.15).collect(),
        own.iter().map(|z| 4.0 * z).collect(),
        own.iter().map(|z| 0.1 * z).collect(),
    ];
    for history in far {
        let state = TRAINED.initial_state(Some(&history), None).unwrap();
        let advice = TRAINED.advise(0, &state, AdviceMode::Surrogate);
        assert_eq!((advice.in_design, advice.source), (false, AdviceSource::ResolvedOutsideDesign), "{history:?}");
        let solved = TRAINED.advise(0, &state, AdviceMode::Resolve);
        assert_eq!(advice.allocation, solved.allocation);
        assert_eq!(advice.certainty_equivalent, solved.certainty_equivalent);
    }
    let state = TRAINED.initial_state(None, None).unwrap();
    assert_eq!(TRAINED.advise(0, &state, AdviceMode::Surrogate).source, AdviceSource::PolicySurrogate);
}

#[test]
fn diagnostics_are_those_of_the_design_points() {
    // Where the state is wealth alone, the design points are a ladder that anybody can climb.
    let mut request = request(1, 40);
    request["problem"]["framework"] = json!("static");
    request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.011 });
    request["problem"]["utility"]["risk_aversion"] = json!(0.05);
    request["design"] = json!({ "count": 40 });
    let specification = specification(request.clone());
    let policy = crate::support::policies::train(request);
    let (problem, design) = (Problem::new(&specification), Design::new(&specification));
    let step = BellmanStep { problem: &problem, step: 1, next: &NextValue::Terminal };
    let solved: Vec<_> = (0..40).map(|index| step.solve(&design.state(1, index))).collect();
    let found = &policy.steps()[1].diagnostics;
    let share = |holds: &[bool]| holds.iter().filter(|holds| **holds).count() as f64 / 40.0;
    let all_bank: Vec<bool> = solved.iter().map(|one| one.action <= 0.0).collect();
    let uncertified: Vec<bool> = solved.iter().map(|one| !one.certified).collect();
    assert_eq!((found.design_count, found.all_bank_share), (40, share(&all_bank)));
    assert_eq!(found.uncertified_share, share(&uncertified));
    let gap = solved.iter().map(|one| one.duality_gap.abs()).fold(0.0, f64::max);
    assert_eq!(found.duality_gap, gap);
    // At convergence the two values differ by the rounding of sums of a few hundred numbers.
    assert!(gap < 1e-12, "{gap:e}");
}
