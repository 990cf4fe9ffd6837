//! One robust step: what its certificate, its duality gap and its window promise.

use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::field::Field;
use ballast::control::bellman::gain_field::GainField;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::bellman::solution::{Adversary, RobustSolution};
use ballast::control::policy::advisor::Advisor;
use ballast::control::policy::worst_case::most_cost;
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::problem::utility::{RelativeUtility, utility};
use ballast::control::request::learning::Learning;
use ballast::control::request::specification::{Specification, UtilitySpecification};
use serde_json::{Value, json};

const HISTORY: [f64; 8] = [0.031, -0.044, 0.062, 0.043, -0.018, 0.027, 0.055, -0.009];
const RADII: [f64; 6] = [0.0, 0.001, 0.004, 0.01, 0.03, 0.1];

fn support_of(bounds: Option<[f64; 2]>) -> Value {
    bounds.map_or(json!({ "rule": "none" }), |[min, max]| json!({ "rule": "between", "min": min, "max": max }))
}

/// A part of wealth is always in the bank, so that every loss is bounded.
fn problem(radius: f64, utility: &Value, support: Option<[f64; 2]>) -> Problem {
    let mut request = json!({ "problem": { "horizon": 1, "rate_per_step": 0.002, "history": HISTORY, "utility": utility,
        "action_interval": [0.0, 0.95], "radius": { "rule": "fixed", "radius": radius } } });
    request["problem"]["support"] = support_of(support);
    Problem::new(&serde_json::from_value::<Specification>(request).unwrap().completed().unwrap())
}

/// The last step at the history, by the actions `solve` asks for.
fn last_step(problem: &Problem, solve: impl Fn(BellmanStep, &State) -> RobustSolution) -> RobustSolution {
    let state = State::new(&HISTORY, 100.0, Learning::default()).unwrap();
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
fn wealth_whose_utility_no_longer_grows_has_a_finite_value_and_gap() {
    let problem = problem(0.01, &json!({ "kind": "exponential", "risk_aversion": 1.0 }), None);
    for wealth in [1e3, 1e6, 1e15] {
        let state = State::new(&HISTORY, wealth, Learning::default()).unwrap();
        let found = BellmanStep { problem: &problem, step: 0, next: &NextValue::Terminal }.solve(&state);
        assert!(found.floor_gain >= 0.0 && found.floor_gain.is_finite(), "{wealth}: {found:?}");
        assert!(found.duality_gap.is_finite(), "{wealth}: {found:?}");
    }
}

/// The lowest and the highest return of the window that a step ended with.
fn window(solution: &RobustSolution) -> [f64; 2] {
    let Adversary::Transport { support, .. } = &solution.adversary else { panic!("{solution:?}") };
    [support[0], support[support.len() - 1]]
}

#[test]
fn a_window_that_is_too_small_grows_until_it_is_certified() {
    // Of 0.95 of wealth nearly all may be lost, and a wide ball reaches for it past the first window.
    let utility = json!({ "kind": "power", "risk_aversion": 4.0 });
    let [lowest, highest] = [-0.044, 0.062];
    let price = |radius: f64, action: f64, support| {
        last_step(&problem(radius, &utility, support), |step, state| step.price(state, action))
    };
    let small = price(0.001, 0.1, None);
    assert!(small.certified, "{small:?}");
    for (found, first) in window(&small).into_iter().zip([lowest - 0.6, highest + 0.3]) {
        assert!((found - first).abs() < 1e-12, "{found} and not {first}: this window need not grow");
    }
    let grown = price(0.1, 0.95, None);
    assert!(grown.certified && window(&grown)[0] < lowest - 1.1, "{:?}", window(&grown));
    // Within the first window the same step would have looked better than it is.
    let cut_off = price(0.1, 0.95, Some([lowest - 0.6, highest + 0.3]));
    assert!(cut_off.floor_gain > grown.floor_gain + 1e-3, "{} {}", cut_off.floor_gain, grown.floor_gain);
    let whole = price(0.1, 0.95, Some([-8.0, 5.0]));
    assert!((whole.floor_gain - grown.floor_gain).abs() < 1e-6, "{} {}", whole.floor_gain, grown.floor_gain);
}

/// Sixteen equal gaps from the lowest return do not end at the highest to the last digit. Mass that moved from one to the other
/// would be told as moved.
#[test]
fn returns_that_rounding_tells_apart_are_one() {
    let (lowest, highest) = (-0.3, 0.1);
    assert!(lowest + 16.0 * ((highest - lowest) / 16.0) != highest);
    let history = [0.05, lowest, 0.02, highest];
    let request = json!({ "problem": { "horizon": 1, "rate_per_step": 0.002, "history": history,
        "utility": { "kind": "log" }, "action_interval": [0.0, 0.95], "radius": { "rule": "fixed", "radius": 0.004 } } });
    let problem = Problem::new(&serde_json::from_value::<Specification>(request).unwrap().completed().unwrap());
    let state = State::new(&history, 100.0, Learning::default()).unwrap();
    let found = BellmanStep { problem: &problem, step: 0, next: &NextValue::Terminal }.price(&state, 0.5);
    let Adversary::Transport { support, .. } = &found.adversary else { panic!("{found:?}") };
    assert!(support.contains(&highest) && support.windows(2).all(|pair| pair[1] - pair[0] > 1e-12), "{support:?}");
}

/// The first of two steps at the history; what is learned of a return is worth this in the second, whatever is held.
fn first_step(problem: &Problem) -> RobustSolution {
    let holdings = problem.holdings(1).count();
    let gain = move |state: &State| {
        let atoms = state.law.atoms();
        let worth = 0.05 * (10.0 * atoms.iter().sum::<f64>() / atoms.len() as f64).tanh().max(0.0);
        vec![worth; holdings]
    };
    let state = State::new(&HISTORY, 100.0, Learning::default()).unwrap();
    BellmanStep { problem, step: 0, next: &NextValue::Exact(problem.holdings(1), Box::new(gain)) }.solve(&state)
}

#[test]
fn a_certified_value_is_that_over_all_returns_where_steps_follow() {
    let problem = |radius: f64, support: Option<[f64; 2]>| {
        let mut request = json!({ "problem": { "horizon": 2, "rate_per_step": 0.002, "history": HISTORY, "action_interval": [0.0, 0.95],
            "utility": { "kind": "power", "risk_aversion": 4.0 }, "radius": { "rule": "fixed", "radius": radius } } });
        request["problem"]["support"] = support_of(support);
        Problem::new(&serde_json::from_value::<Specification>(request).unwrap().completed().unwrap())
    };
    for radius in RADII {
        let (found, wide) = (first_step(&problem(radius, None)), first_step(&problem(radius, Some([-8.0, 5.0]))));
        assert!(found.certified && found.floor_gain > 0.0, "{radius}: {found:?}");
        // The next value bends where its mean passes 0, between returns at which it is exact: a cubic is off by a few 1e-6.
        assert!((found.floor_gain - wide.floor_gain).abs() < 1e-5, "{radius}: {found:?} {wide:?}");
    }
}

/// A holding after a crash is worth next to nothing, and selling it costs a share of that.
#[test]
fn a_certificate_goes_down_to_a_total_loss_where_trading_costs() {
    let request = |cost: f64, radius: f64| {
        json!({ "problem": { "horizon": 2, "rate_per_step": 0.002, "history": HISTORY, "action_interval": [0.0, 0.95],
            "trading_cost": cost, "utility": { "kind": "power", "risk_aversion": 4.0 }, "support": { "rule": "none" },
            "radius": { "rule": "fixed", "radius": radius } } })
    };
    for radius in RADII {
        for cost in [0.001, 0.02] {
            let request = serde_json::from_value::<Specification>(request(cost, radius)).unwrap();
            let found = first_step(&Problem::new(&request.completed().unwrap()));
            assert!(found.certified, "{cost} {radius}: {found:?}");
        }
    }
}

/// Lower bound of the worst expectation of relative utility on a support by duality, the best of all multipliers: plain code.
fn best_dual(support: &[f64], payoff: &[f64], radius: f64) -> f64 {
    let dual = |gamma: f64| {
        let worst_from = |atom: &f64| {
            let moved = support.iter().zip(payoff).map(|(z, value)| value + gamma * (z - atom).abs());
            moved.fold(f64::INFINITY, f64::min)
        };
        HISTORY.iter().map(worst_from).sum::<f64>() / HISTORY.len() as f64 - gamma * radius
    };
    // Concave in the multiplier: thirds, until nothing is left between.
    let (mut low, mut high) = (0.0, 1e3);
    for _ in 0..200 {
        let [left, right] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if dual(left) < dual(right) { low = left } else { high = right }
    }
    dual(low)
}

#[test]
fn the_reported_gap_bounds_the_error_of_the_value() {
    for (utility, relative) in [
        (json!({ "kind": "power", "risk_aversion": 4.0 }), (|w: f64| (1.0 - (-3.0 * w).exp()) / 3.0) as fn(f64) -> f64),
        (json!({ "kind": "log" }), |w| w),
    ] {
        for radius in RADII {
            for action in [0.1, 0.5, 0.9] {
                let problem = problem(radius, &utility, Some([-1.0, 1.0]));
                let found = last_step(&problem, |step, state| step.price(state, action));
                let Adversary::Transport { support, moves } = &found.adversary else { panic!("{found:?}") };
                let growth = |z: &f64| (1.0 - action) * 1.002 + action * z.exp();
                let payoff: Vec<f64> = support.iter().map(|z| relative((growth(z) / 1.002).ln())).collect();
                let truth = best_dual(support, &payoff, radius);
                let value = relative(found.floor_gain);
                let bound = relative(found.floor_gain - found.duality_gap);
                // Sums of eight utilities of size 1, and the multiplier by thirds, where the dual is flat.
                let rounding = 1e-12;
                assert!(bound <= truth + rounding, "{utility} {radius} {action}: {bound} is no lower bound of {truth}");
                assert!(value >= truth - rounding, "{utility} {radius} {action}: {value} is less than {truth}");
                // The law that is reported has the value that is reported, and lies within the ball.
                let reached: f64 = moves.iter().map(|moved| moved.mass * payoff[moved.to]).sum();
                let spent: f64 =
                    moves.iter().map(|moved| moved.mass * (support[moved.to] - support[moved.from]).abs()).sum();
                assert!((reached - value).abs() < rounding, "{utility} {radius} {action}: {reached} {value}");
                assert!(spent <= radius + rounding, "{utility} {radius} {action}: {spent}");
            }
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
fn a_support_bounds_where_mass_may_go() {
    for utility in utilities() {
        let price =
            |radius: f64, support| last_step(&problem(radius, &utility, support), |step, state| step.price(state, 0.9));
        let (bounded, free) = (price(0.03, Some([-0.06, 0.08])), price(0.03, None));
        let Adversary::Transport { support, moves } = &bounded.adversary else { panic!("{bounded:?}") };
        assert!(moves.iter().all(|moved| (-0.06..=0.08).contains(&support[moved.to])), "{utility}: {moves:?}");
        // Fewer laws are no worse; these bounds forbid the worst of all, but for log utility, which loses most where the
        // highest returns come down.
        let gained = if utility["kind"] == "log" { 0.0 } else { 1e-4 };
        assert!(bounded.floor_gain >= free.floor_gain + gained, "{utility}: {bounded:?} {free:?}");
        // All mass at the lowest return is as far as it goes: the mean of the history is 0.018, 0.078 above it.
        let [far, farther] = [0.1, 1.0].map(|radius| price(radius, Some([-0.06, 0.08])).floor_gain);
        let lowest = (0.1 + 0.9 * f64::exp(-0.06) / 1.002).ln();
        assert!((far - lowest).abs() < 1e-12 && (farther - lowest).abs() < 1e-12, "{utility}: {far} {lowest}");
    }
}

#[test]
fn the_tabulated_field_is_the_value_of_the_next_state() {
    let flows = [(0.0, 0.0), (0.01, 0.0), (0.0, 30.0), (0.01, -30.0)];
    for (utility, (cost, flow)) in utilities().iter().flat_map(|utility| flows.map(|flow| (utility, flow))) {
        let request = json!({ "problem": { "horizon": 2, "rate_per_step": 0.002, "history": HISTORY, "utility": utility, "trading_cost": cost,
            "contributions": [flow, -0.7 * flow], "radius": { "rule": "fixed", "radius": 0.004 } }, "design": { "count": 60 } });
        let solved = crate::support::policies::advisor(request);
        let (problem, after) = (solved.policy().problem(Default::default()), &solved.policy().steps()[1].solution);
        let next = NextValue::new(solved.specification(), 1, Some(after));
        let state = State::new(&HISTORY, 100.0, Learning::default()).unwrap().with_holding(0.4).unwrap();
        let (dynamics, floor) = (problem.dynamics(0), problem.floor(0, &state));
        let relative = RelativeUtility::new(solved.specification().problem.utility, floor);
        let exact_at: Vec<f64> = (0..=40).map(|k| -0.06 + 0.0035 * f64::from(k)).collect();
        let field = GainField::tabulate(&problem, 0, &next, relative, &state, exact_at);
        // Between the returns and the actions at which it is tabulated.
        let returns: Vec<f64> = (0..20).map(|k| -0.055 + 0.0061 * f64::from(k)).collect();
        for action in [0.0, 0.13, 0.5, 0.77, 1.0].map(|share| share * problem.actions(0, &state).highest) {
            let trade = dynamics.trade_to(state.holding, action);
            for (z, found) in returns.iter().zip(field.at(&returns).payoff(trade)) {
                let then = solved.advance(0, &state, &PeriodOutcome::of(action, *z));
                let gain = (problem.floor(1, &then) / floor).ln() + solved.surrogate(1, &then).1;
                // The cubics are good to 1e-6 of the gain; where trading costs, a value bends where its law's band passes the
                // holding, and they are good to a tenth of the half basis point that a surrogate may err by.
                let (error, tolerance) = (found - relative.value(gain), if cost > 0.0 { 5e-6 } else { 1e-6 });
                assert!(error.abs() < tolerance, "{utility} {cost} {flow} {action} {z}: {found} {gain}");
            }
        }
    }
}

/// An investor who holds the highest action, 0.3, under the radius given and under those near it.
fn last_step_of_at_most_a_third(kind: &Value, radius: f64) -> (Advisor, State, UtilitySpecification) {
    let request = json!({ "problem": { "horizon": 1, "rate_per_step": 0.002, "history": HISTORY, "utility": kind,
        "action_interval": [0.0, 0.3], "radius": { "rule": "fixed", "radius": radius } } });
    let solved = crate::support::policies::advisor(request);
    let utility_of = solved.specification().problem.utility;
    (solved, State::new(&HISTORY, 100.0, Learning::default()).unwrap(), utility_of)
}

#[test]
fn the_multiplier_is_the_utility_lost_per_unit_of_radius() {
    for kind in utilities() {
        let (solved, state, utility_of) = last_step_of_at_most_a_third(&kind, 0.004);
        let at = |radius: f64| {
            let (advice, worst) = solved.explain_within(0, &state, radius);
            assert_eq!(advice.allocation, 0.3, "{kind}: the same is held on either side");
            (utility(utility_of, advice.certainty_equivalent), worst.multiplier)
        };
        let (step, [below, middle, above]) = (1e-5, [0.00399, 0.004, 0.00401].map(at));
        let slope = (below.0 - above.0) / (2.0 * step);
        // The slope of the utility changes by its curvature times the step, and utilities have thirteen digits.
        assert!((middle.1 / slope - 1.0).abs() < 1e-2, "{kind}: {} against {slope}", middle.1);
    }
}

/// Solved at the wider radius, with an allocation that moves: by a hundred slopes, beyond what is above the floor, where the slope
/// alone would promise more than there is to lose.
#[test]
fn a_wider_ball_costs_at_most_what_is_said() {
    let mut less_than_the_slope = 0;
    for kind in utilities() {
        for radius in [0.0005, 0.002, 0.004, 0.006] {
            let request = json!({ "problem": { "horizon": 1, "rate_per_step": 0.002, "history": HISTORY, "utility": kind,
                "radius": { "rule": "fixed", "radius": radius } } });
            let solved = crate::support::policies::advisor(request);
            let state = State::new(&HISTORY, 100.0, Learning::default()).unwrap();
            let at = |radius: f64| solved.explain_within(0, &state, radius);
            let (advice, worst) = at(radius);
            for wider in [0.0001, 0.001, 0.01] {
                let cost = 1e4 * (advice.certainty_equivalent / at(radius + wider).0.certainty_equivalent).ln();
                let bound = most_cost(wider, worst.radius_cost, &advice);
                // Allocations are found to 1e-6, which moves the worth by less.
                assert!(cost <= bound + 1e-3, "{kind} {radius} {wider}: {cost} of {bound}");
                less_than_the_slope += usize::from(bound < 0.99e4 * wider * worst.radius_cost);
            }
        }
    }
    assert!(less_than_the_slope > 0);
}

/// Paper, section 2.4, for an order-1 ball: to first order a radius costs the largest slope of the payoff down from any
/// return seen, however far, and not the mean slope at the returns.
#[test]
fn a_little_radius_costs_the_largest_slope() {
    for kind in utilities() {
        let (solved, state, utility_of) = last_step_of_at_most_a_third(&kind, 0.0);
        let at = |radius: f64| {
            let (advice, worst) = solved.explain_within(0, &state, radius);
            assert_eq!(advice.allocation, 0.3, "{kind}");
            (advice.certainty_equivalent.ln(), worst.radius_cost)
        };
        let radius = 1e-5;
        let (without, (gain, cost)) = (at(0.0).0, at(radius));
        assert!((cost * radius / (without - gain) - 1.0).abs() < 1e-2, "{kind}: {cost}");
        let payoff = |z: f64| utility(utility_of, 100.0 * (0.7 * 1.002 + 0.3 * z.exp()));
        let slope = |z: f64, far: f64| (payoff(z) - payoff(z - far)) / far;
        let down = |z: f64| (1..=2000).map(|far| slope(z, 0.002 * f64::from(far))).fold(slope(z, 1e-6), f64::max);
        let largest = HISTORY.map(down).into_iter().fold(0.0, f64::max);
        let mean = HISTORY.map(|z| slope(z, 1e-6)).iter().sum::<f64>() / HISTORY.len() as f64;
        // The certainty equivalent moves by the utility's over its slope there and the wealth.
        let wealth = without.exp();
        let marginal = (utility(utility_of, wealth + 1e-3) - utility(utility_of, wealth - 1e-3)) / 2e-3;
        let [largest, mean] = [largest, mean].map(|slope| slope / (marginal * wealth));
        assert!((cost / largest - 1.0).abs() < 1e-2 && cost > 1.01 * mean, "{kind}: {cost} {largest} {mean}");
    }
}

#[test]
fn a_loss_however_deep_has_a_utility() {
    for kind in utilities() {
        let relative = RelativeUtility::new(serde_json::from_value(kind.clone()).unwrap(), 1e6);
        for gain in [-1.0, -50.0, -400.0] {
            assert!(relative.value(gain).is_finite(), "{kind} {gain}: {}", relative.value(gain));
            assert!(relative.value(gain) <= relative.value(0.5 * gain), "{kind} {gain}");
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
    let request = json!({ "problem": { "framework": "static", "horizon": 3, "rate_per_step": 0.002, "history": HISTORY,
        "radius": { "rule": "bridge", "alpha": 0.5, "paths": 200 } } });
    let specification = serde_json::from_value::<Specification>(request.clone()).unwrap().completed().unwrap();
    let frozen = Problem::new(&specification);
    let mut learning = request;
    learning["problem"]["framework"] = json!("adaptive");
    let learning = Problem::new(&serde_json::from_value::<Specification>(learning).unwrap().completed().unwrap());
    let start = State::new(&HISTORY, 100.0, Learning::default()).unwrap();
    let mut later = start.clone();
    later.law.push(0.2);
    assert_eq!(frozen.laws.uncertainty_set(&later.law), frozen.laws.uncertainty_set(&start.law));
    assert_eq!(frozen.laws.uncertainty_set(&start.law), learning.laws.uncertainty_set(&start.law));
    assert_eq!(frozen.laws.measure(&later.law), learning.laws.measure(&start.law));
    assert_ne!(learning.laws.uncertainty_set(&later.law), learning.laws.uncertainty_set(&start.law));
}
