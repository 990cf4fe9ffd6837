//! Values where returns and the adversary lead, beyond the record: against steps solved in each other, without any surrogate.

use crate::support::policies::advisor;
use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::request::specification::Specification;
use ballast::control::surrogate::counts::LEAPING;
use ballast::control::surrogate::design::Design;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;
use serde_json::{Value, json};

const BASIS_POINTS: f64 = 1e4;
/// Holdings at which an exact value is known if trading costs.
const EXACT_HOLDINGS: usize = 65;

/// Returns the value of a step, solved anew at every requested state, over that of the step after.
fn exact(specification: &Specification, step: usize) -> NextValue {
    if step == specification.problem.horizon {
        return NextValue::Terminal;
    }
    let (problem, next) = (Problem::new(specification), exact(specification, step + 1));
    let holdings = problem.holdings(EXACT_HOLDINGS);
    let gains = move |state: &State| {
        // The value at every holding is found best from one in the middle.
        let middle = State { holding: 0.5, ..state.clone() };
        BellmanStep { problem: &problem, step, next: &next }.solve_for_design(&middle, None, holdings).floor_gains
    };
    NextValue::Exact(holdings, Box::new(gains))
}

/// The exact value of a state in basis points over the bank, and the allocation there.
fn truth(specification: &Specification, step: usize, state: &State) -> (f64, f64) {
    let (problem, next) = (Problem::new(specification), exact(specification, step + 1));
    let solution = BellmanStep { problem: &problem, step, next: &next }.solve(state);
    (BASIS_POINTS * solution.floor_gain, solution.action)
}

/// The exact value of an allocation, the best or not, in basis points over the bank.
fn worth(specification: &Specification, step: usize, state: &State, allocation: f64) -> f64 {
    let (problem, next) = (Problem::new(specification), exact(specification, step + 1));
    BASIS_POINTS * BellmanStep { problem: &problem, step, next: &next }.price(state, allocation).floor_gain
}

/// An advice: its value in basis points over the bank, the deviation told, and the allocation.
fn served(solved: &Advisor, step: usize, state: &State) -> (f64, f64, f64) {
    let advice = solved.advise(step, state, AdviceMode::Surrogate);
    let gain = (advice.certainty_equivalent / advice.floor).ln();
    (BASIS_POINTS * gain, BASIS_POINTS * advice.surrogate_sd, advice.allocation)
}

fn request(problem: &Value, design: Value, seed: u64) -> Value {
    json!({ "problem": problem, "design": design, "seed": seed })
}

/// Thirty months of which the best was 8 % and the worst -10 %, over `horizon` periods.
fn thirty_months(horizon: usize) -> Value {
    json!({ "horizon": horizon, "rate_per_step": 0.002, "radius": { "rule": "root_n", "kappa": 0.02 },
        "support": { "rule": "worst_seen", "factor": 2.0 },
        "history": [0.03453, 0.05595, 0.03384, -0.03967, 0.05972, 0.03906, -0.00519, 0.04512, 0.03538, 0.03221, 0.02025, 0.04358,
            -0.01417, 0.01164, -0.00272, 0.04592, 0.02076, 0.00581, -0.01621, 0.0074, 0.01934, 0.00657, 0.07721, 0.06428, -0.10303,
            -0.06603, 0.01111, -2e-05, 0.02859, 0.02875] })
}

/// Eight returns over two periods with costs and withdrawals; the worst law moves an atom to a loss of two thirds.
fn eight_returns(support: &str) -> Value {
    json!({ "history": [0.024363, -0.038933, -0.019198, -0.0039, 0.024904, 0.121799, 0.077903, -0.026938],
        "horizon": 2, "rate_per_step": 0.003, "utility": { "kind": "power", "risk_aversion": 3.0 },
        "radius": { "rule": "bridge", "alpha": 0.1, "paths": 500, "scale": 0.25 }, "support": { "rule": support },
        "trading_cost": 0.005, "contributions": [-20.0, -20.0] })
}

/// Eight returns under exponential utility, of which the last step holds as much as it may.
fn eight_more(support: &str) -> Value {
    json!({ "history": [-0.024569, -0.025858, 0.000281, 0.060619, 0.111905, 0.055849, -0.001061, -0.017166],
        "horizon": 2, "rate_per_step": 0.003, "utility": { "kind": "exponential", "risk_aversion": 0.02 },
        "radius": { "rule": "root_n", "kappa": 0.02 }, "support": { "rule": support },
        "trading_cost": 0.005, "contributions": [5.0, 5.0] })
}

#[test]
fn a_state_better_than_all_that_were_solved_keeps_its_value() {
    let history = [
        0.03729, -0.01857, -0.04181, 0.02943, -0.00875, -0.03286, -0.08103, -0.00815, 0.03209, -0.02782, 0.00726,
        0.03779,
    ];
    let good = [
        0.023174, 0.032901, 0.040134, 0.048933, 0.038294, 0.022883, 0.052789, -0.007364, 0.012784, 0.032272, 0.013782,
        -0.031305,
    ];
    let problem = json!({ "history": history, "horizon": 1, "rate_per_step": 0.002, "support": { "rule": "none" },
        "radius": { "rule": "bridge", "alpha": 0.5, "paths": 500, "scale": 0.3 } });
    let solved = advisor(request(&problem, json!({ "initial_laws": "resampled" }), 1));
    let state = solved.initial_state(Some(&good), None).unwrap();
    let (gain, deviation, _) = served(&solved, 0, &state);
    let (exact, _) = truth(solved.specification(), 0, &state);
    println!("served {gain:.2}, exact {exact:.2}, told {deviation:.2}");
    // Cut off at the largest gain of the design it was 94.
    assert!(exact > 110.0, "{exact}");
    assert!((gain - exact).abs() < 2.0 * deviation.max(0.5), "{gain} for {exact}, told {deviation}");
}

#[test]
fn the_first_step_is_worth_what_steps_in_each_other_are_and_says_how_surely() {
    let eights = ["none", "worst_seen"].into_iter().flat_map(|support| [eight_returns(support), eight_more(support)]);
    for problem in eights.chain([thirty_months(3)]) {
        let horizon = problem["horizon"].as_u64().unwrap();
        let (mut exact, mut before) = (f64::NAN, f64::INFINITY);
        for accuracy in [0.5, 0.1] {
            let solved = advisor(request(&problem, json!({ "accuracy": accuracy }), 1));
            let state = solved.initial_state(None, None).unwrap().with_holding(0.5).unwrap();
            if exact.is_nan() {
                exact = truth(solved.specification(), 0, &state).0;
            }
            let (gain, deviation, _) = served(&solved, 0, &state);
            let claim = solved.policy().steps()[0].diagnostics.expected_error.unwrap();
            println!("T = {horizon}: accuracy {accuracy}: {gain:.3} of {exact:.3}, claimed {:.3}", claim.total);
            assert!((BASIS_POINTS * claim.later(true) - claim.total).abs() < 1e-12 && deviation > 0.0);
            let error = (gain - exact).abs();
            // With costs and withdrawals 0.12 is found where 0.06 is claimed, of the 0.1 that were asked for.
            let most = 1.5 * claim.total.max(accuracy);
            assert!(error < most, "{gain} of {exact}: claimed {}", claim.total);
            // A tighter accuracy is no worse, but for what is asked of it.
            assert!(error < before + accuracy, "{error} after {before}");
            before = error;
        }
    }
}

/// Returns of all sizes within the support, [-0.206, 0.203].
#[test]
fn after_one_return_of_any_size_the_value_is_that_of_steps_in_each_other() {
    let solved = advisor(request(&thirty_months(3), json!({ "accuracy": 0.1 }), 1));
    let first = solved.initial_state(None, None).unwrap();
    let action = served(&solved, 0, &first).2;
    for log_return in [-0.2, -0.16, -0.1, 0.1, 0.14, 0.18, 0.2] {
        let state = solved.advance(0, &first, &PeriodOutcome::of(action, log_return));
        let (gain, deviation, allocation) = served(&solved, 1, &state);
        let (exact, best) = truth(solved.specification(), 1, &state);
        println!("{log_return:+.2}: {gain:.3} of {exact:.3}, told {deviation:.3}; {allocation:.4} of {best:.4}");
        // Cut off at the largest gain of the design, or extrapolated, it was off by tens.
        assert!((gain - exact).abs() < 0.5, "{log_return}: {gain} of {exact}, told {deviation}");
        // An allocation may differ where hardly anything is lost by it.
        let lost = exact - worth(solved.specification(), 1, &state, allocation);
        assert!((allocation - best).abs() < 0.005 || lost < 0.1, "{log_return}: {allocation} of {best} loses {lost}");
    }
}

/// Problem number `index` of those drawn at random, with at most so many returns and periods.
fn drawn(index: usize, most_returns: usize, most_periods: usize) -> Value {
    let mut generator = stream(20_261_127, "problem", 0, index);
    let mut up_to = |most: usize| generator.random_range(0..=most);
    let (returns, horizon) = (3 + up_to(most_returns - 3), 2 + up_to(most_periods - 2));
    let (size, premium) = (0.01 + 0.005 * up_to(10) as f64, 0.001 * up_to(12) as f64);
    let history: Vec<f64> = (0..returns).map(|_| premium + size * (up_to(2000) as f64 / 1000.0 - 1.0)).collect();
    let utility = match up_to(2) {
        0 => json!({ "kind": "log" }),
        1 => json!({ "kind": "power", "risk_aversion": 2.0 + up_to(6) as f64 }),
        _ => json!({ "kind": "exponential", "risk_aversion": 0.01 * (1 + up_to(4)) as f64 }),
    };
    let support = match up_to(2) {
        0 => json!({ "rule": "none" }),
        1 => json!({ "rule": "worst_seen", "factor": 2.0 }),
        _ => json!({ "rule": "between", "min": -0.4, "max": 0.3 }),
    };
    let centre = match up_to(2) {
        0 => json!({ "kind": "smoothed", "bandwidth": 0.25 * size }),
        1 => json!({ "kind": "mixed", "history": [size, -size], "weight": 6.0 }),
        _ => json!({ "kind": "empirical" }),
    };
    let cost = [0.0, 0.0, 0.005, 0.05][up_to(3)];
    let flow = [0.0, 0.0, 2.0, -1.0][up_to(3)];
    json!({ "history": history, "horizon": horizon, "rate_per_step": 0.001, "utility": utility, "support": support,
        "radius": { "rule": "bridge", "alpha": 0.3, "paths": 200, "scale": 0.3 }, "centre": centre, "trading_cost": cost,
        "contributions": flow })
}

/// Returns the error claimed of the last step, and the one found at fresh states of which one in eight leaps, at any holding.
fn claimed_and_found(problem: &Value, accuracy: f64, states: usize) -> (f64, f64) {
    let design = json!({ "accuracy": accuracy, "initial_laws": "resampled" });
    let solved = advisor(request(problem, design, 1));
    let step = solved.policy().steps().len() - 1;
    let fresh = Design::new(&Specification { seed: 1_000_003, ..solved.specification().clone() });
    let square = |index: usize| {
        let holding = stream(1_000_003, "holding", 0, index).random::<f64>();
        let number = if index.is_multiple_of(8) { LEAPING + index / 8 } else { index };
        let state = State { holding, ..fresh.state(step, number) };
        let (exact, _) = truth(solved.specification(), step, &state);
        (served(&solved, step, &state).0 - exact).powi(2)
    };
    let found = (0..states).map(square).sum::<f64>() / states as f64;
    let claim = solved.policy().steps()[step].diagnostics.expected_error.unwrap();
    (claim.own, found.sqrt())
}

/// Returns the error claimed of the first step with those after it, and the one found at fresh records in the design beside
/// a policy with more design points.
fn claimed_and_found_at_first(problem: &Value, fine: &Advisor, accuracy: f64, seed: u64, records: usize) -> (f64, f64) {
    let solved = advisor(request(problem, json!({ "accuracy": accuracy, "initial_laws": "resampled" }), seed));
    let fresh = Design::new(&Specification { seed: 1_000_003, ..solved.specification().clone() });
    let states = (0..records).map(|index| fresh.state(0, index));
    let in_design = |policy: &Advisor, state: &State| policy.advise(0, state, AdviceMode::Surrogate).in_design;
    let errors: Vec<f64> = states
        .filter(|state| in_design(&solved, state) && in_design(fine, state))
        .map(|state| served(&solved, 0, &state).0 - served(fine, 0, &state).0)
        .collect();
    let found = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    (solved.policy().steps()[0].diagnostics.expected_error.unwrap().total, found.sqrt())
}

fn check_claims(problems: usize, (most_returns, most_periods): (usize, usize), accuracy: f64, states: usize) {
    let judged: Vec<(f64, f64)> = (0..problems)
        .map(|index| {
            let problem = drawn(index, most_returns, most_periods);
            let (claimed, found) = claimed_and_found(&problem, accuracy, states);
            println!("{index}: claimed {claimed:.3}, found {found:.3}: {problem}");
            (claimed, found)
        })
        .collect();
    // A claim of no error is one of rounding.
    let missed: Vec<_> = judged.iter().filter(|(claimed, found)| *found > 1.5 * claimed + 0.02 * accuracy).collect();
    assert!(missed.is_empty(), "{missed:?} of {judged:?}");
}

#[test]
fn no_more_is_found_than_is_claimed_of_some_random_problems() {
    check_claims(4, (40, 3), 2.0, 160);
}

#[test]
#[ignore = "takes an hour"]
fn no_more_is_found_than_is_claimed_of_thirty_random_problems() {
    check_claims(30, (240, 24), 0.5, 800);
}

/// Errors have heavy tails and a claim rests on 200 states of a step, so some claims are too small: the middle one is not.
fn check_claims_of_the_first(problems: &[Value], seeds: u64, accuracy: f64, points: usize, records: usize) {
    let ratios_of = |problem: &Value| -> Vec<f64> {
        let fine = advisor(request(problem, json!({ "count": points, "initial_laws": "resampled" }), 1_000));
        let ratio = |seed: u64| {
            let (claimed, found) = claimed_and_found_at_first(problem, &fine, accuracy, seed, records);
            println!("claimed {claimed:.3}, found {found:.3}: {problem}");
            found / claimed
        };
        (0..seeds).map(ratio).collect()
    };
    let mut ratios: Vec<f64> = problems.iter().flat_map(ratios_of).collect();
    ratios.sort_by(f64::total_cmp);
    let middle = ratios[ratios.len() / 2];
    assert!(middle < 1.5 && middle > 1.0 / 3.0, "{ratios:?}");
}

#[test]
fn the_errors_of_all_steps_add_up_to_what_is_found_at_the_first() {
    let mut problem = thirty_months(6);
    problem["utility"] = json!({ "kind": "power", "risk_aversion": 5.0 });
    check_claims_of_the_first(&[problem], 3, 2.0, 500, 60);
}

#[test]
#[ignore = "takes half an hour"]
fn the_errors_of_all_steps_of_thirty_random_problems_add_up_to_what_is_found_at_the_first() {
    let problems: Vec<Value> = (0..30).map(|index| drawn(index, 240, 24)).collect();
    check_claims_of_the_first(&problems, 1, 0.5, 3000, 400);
}
