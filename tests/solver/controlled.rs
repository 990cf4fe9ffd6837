//! The general solver of controlled problems: the investor's problem by it is what the investor's own solver finds.

use ballast::control::controlled_training::ControlledPolicy;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::investor::{Investor, Position};
use ballast::control::problem::state::State;
use ballast::control::progress::Watch;
use ballast::control::request::learning::Learning;
use ballast::control::request::specification::Specification;
use ballast::control::training::Training;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use serde_json::{Value, json};

const BASIS_POINTS: f64 = 1e4;
const HISTORY: [f64; 8] = [0.061, -0.034, 0.052, 0.013, -0.041, 0.083, -0.022, 0.037];

/// Both solvers at the start, in basis points of certainty equivalent, and in action.
fn compared(problem: Value, count: usize, holding: f64) -> (f64, f64) {
    let request = json!({ "problem": problem, "design": { "count": count } });
    let specification: Specification = serde_json::from_value(request).unwrap();
    let specification = specification.completed().unwrap();
    let solved = Advisor::new(Training::new(&specification).unwrap().run(&Watch::unwatched()).unwrap());
    let state = State::new(&HISTORY, 100.0, Learning::default()).unwrap().with_holding(holding).unwrap();
    let own = solved.advise(0, &state, AdviceMode::Resolve);
    let investor = Investor::new(&specification.problem);
    let start = Position { wealth: 100.0, holding };
    let policy = ControlledPolicy::train(&investor, &start, &specification, &Watch::unwatched()).unwrap();
    let found = policy.step(&investor, 0).solve(&start, &EmpiricalDistribution::new(&HISTORY));
    assert!(own.allocation > 0.02 && own.allocation < 0.98, "{own:?}");
    (BASIS_POINTS * (found.certainty_equivalent / own.certainty_equivalent).ln(), found.actions[0] - own.allocation)
}

#[test]
fn the_investor_s_problem_is_solved_alike_by_the_general_solver() {
    let ball = || json!({ "rule": "root_n", "kappa": 0.01 });
    let bounded = || json!({ "rule": "between", "min": -0.4, "max": 0.4 });
    let power = || json!({ "kind": "power", "risk_aversion": 20.0 });
    let known =
        || json!({ "kind": "gaussian_mixture", "components": [{ "weight": 1.0, "mean": 0.006, "variance": 0.002 }] });
    for (problem, holding) in [
        (json!({ "framework": "adaptive", "utility": power(), "support": bounded() }), 0.0),
        (json!({ "framework": "static", "support": bounded(), "utility": power() }), 0.0),
        (
            json!({ "framework": "adaptive", "utility": power(), "support": { "rule": "none" }, "contributions": 8.0 }),
            0.0,
        ),
        (
            json!({ "framework": "static", "support": bounded(), "utility": { "kind": "exponential", "risk_aversion": 0.15 } }),
            0.0,
        ),
        (
            json!({ "framework": "static", "support": bounded(), "utility": power(), "contributions": [-10.0, -20.0] }),
            0.0,
        ),
        (json!({ "framework": "static", "support": bounded(), "utility": power(), "trading_cost": 0.004 }), 0.8),
        (
            json!({ "framework": "static", "support": bounded(), "utility": power(), "trading_cost": 0.004,
            "contributions": [10.0, -20.0] }),
            0.0,
        ),
        (json!({ "framework": "known_law", "law": known(), "utility": power(), "contributions": [-30.0, 60.0] }), 0.0),
    ] {
        let costly = problem["trading_cost"].is_number();
        let mut problem = problem;
        (problem["horizon"], problem["history"], problem["rate_per_step"]) = (json!(2), json!(HISTORY), json!(0.002));
        if problem["framework"] != "known_law" {
            problem["radius"] = ball();
        }
        let what = problem.to_string();
        let (error, off) = compared(problem, 100, holding);
        // Where trading costs, each has an error of its own at the ends of the band, as `tests/solver/costs.rs` grants; else both
        // regress the same function.
        let (most, furthest) = if costly { (0.2, 0.01) } else { (0.01, 1e-3) };
        assert!(error.abs() < most && off.abs() < furthest, "{what}: {error} bp, {off}");
    }
}
