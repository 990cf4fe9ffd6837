//! One robust step: what its certificate, its duality gap and its window promise.

use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::bellman::solution::RobustSolution;
use ballast::control::problem::state::State;
use ballast::control::request::specification::Specification;
use serde_json::{Value, json};

const HISTORY: [f64; 8] = [0.031, -0.044, 0.062, 0.043, -0.018, 0.027, 0.055, -0.009];
const RADII: [f64; 6] = [0.0, 0.001, 0.004, 0.01, 0.03, 0.1];

/// A part of wealth is always in the bank, so that every loss is bounded.
fn problem(radius: f64, utility: &Value, support: Option<[f64; 2]>) -> Problem {
    let mut request = json!({ "problem": { "horizon": 1, "history": HISTORY, "utility": utility,
        "action_interval": [0.0, 0.95], "radius": { "rule": "fixed", "radius": radius } } });
    if let Some([min, max]) = support {
        request["problem"]["support"] = json!({ "min": min, "max": max });
    }
    Problem::new(&serde_json::from_value::<Specification>(request).unwrap().completed().unwrap())
}

/// The last step at the history, by the actions `solve` asks for.
fn last_step(problem: &Problem, solve: impl Fn(BellmanStep, &State) -> RobustSolution) -> RobustSolution {
    let state = State::new(&HISTORY, 100.0).unwrap();
    solve(BellmanStep { problem, step: 0, next: &NextValue::Terminal }, &state)
}

fn utilities() -> [Value; 3] {
    [
        json!({ "kind": "exponential", "risk_aversion": 0.05 }),
        json!({ "kind": "power", "risk_aversion": 4.0 }),
        json!({ "kind": "log" }),
    ]
}

#[test]
fn a_certified_value_is_that_over_all_returns() {
    for utility in utilities() {
        for radius in RADII {
            let found = last_step(&problem(radius, &utility, None), |step, state| step.solve(state));
            assert!(found.certified, "{utility} {radius}: {found:?}");
            let wide = last_step(&problem(radius, &utility, Some([-8.0, 5.0])), |step, state| step.solve(state));
            // Both place destinations to 1/256 of an interval between exact returns.
            assert!((found.floor_gain - wide.floor_gain).abs() < 1e-7, "{utility} {radius}: {found:?} {wide:?}");
        }
    }
}

#[test]
fn a_loss_without_bound_is_not_certified() {
    // All in the asset, power utility falls like e^(3 |z|) where the distance costs |z|: every window is left.
    let problem = problem(0.03, &json!({ "kind": "power", "risk_aversion": 4.0 }), None);
    let all_in = last_step(&problem, |step, state| step.price(state, 1.0));
    assert!(!all_in.certified, "{all_in:?}");
    // With a part in the bank the loss is bounded, and some window holds the worst law.
    let half = last_step(&problem, |step, state| step.price(state, 0.5));
    assert!(half.certified && half.floor_gain > all_in.floor_gain, "{half:?}");
}

#[test]
fn primal_and_dual_meet_at_every_radius() {
    for utility in utilities() {
        for radius in RADII {
            for action in [0.1, 0.5, 0.9] {
                let problem = problem(radius, &utility, Some([-1.0, 1.0]));
                let found = last_step(&problem, |step, state| step.price(state, action));
                assert!(found.duality_gap.abs() < 1e-10, "{utility} {radius} {action}: {}", found.duality_gap);
            }
        }
    }
}

#[test]
fn another_radius_is_that_of_a_problem_that_has_it() {
    for utility in utilities() {
        let other = last_step(&problem(0.02, &utility, None), |step, state| step.solve_within(state, 0.005));
        assert_eq!(other, last_step(&problem(0.005, &utility, None), |step, state| step.solve(state)));
        let none = last_step(&problem(0.02, &utility, None), |step, state| step.solve_within(state, 0.0));
        assert_eq!(none, last_step(&problem(0.0, &utility, None), |step, state| step.solve(state)));
    }
}

#[test]
fn what_is_frozen_is_the_set_of_the_history_at_every_state() {
    let request = json!({ "problem": { "framework": "static", "horizon": 3, "history": HISTORY,
        "radius": { "rule": "bridge", "alpha": 0.5, "paths": 200 } } });
    let specification = serde_json::from_value::<Specification>(request.clone()).unwrap().completed().unwrap();
    let frozen = Problem::new(&specification);
    let mut learning = request;
    learning["problem"]["framework"] = json!("adaptive");
    let learning = Problem::new(&serde_json::from_value::<Specification>(learning).unwrap().completed().unwrap());
    let start = State::new(&HISTORY, 100.0).unwrap();
    let mut later = start.clone();
    later.law.push(0.2);
    assert_eq!(frozen.uncertainty_set(&later), frozen.uncertainty_set(&start));
    assert_eq!(frozen.uncertainty_set(&start), learning.uncertainty_set(&start));
    assert_eq!(frozen.measure(&later), learning.measure(&start));
    assert_ne!(learning.uncertainty_set(&later), learning.uncertainty_set(&start));
}
