//! Trading cost: whole horizons against programs of other authors, and what must hold of any cost.

use ballast::control::policy::advice::Advice;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::state::State;
use ballast::control::request::learning::Learning;
use serde_json::{Value, json};

const BASIS_POINTS: f64 = 1e4;
const HISTORY: [f64; 8] = [0.061, -0.034, 0.052, 0.013, -0.041, 0.083, -0.022, 0.037];

fn state(solved: &Advisor, wealth: f64, holding: f64) -> State {
    State::new(&solved.specification().problem.history, wealth, Learning::default())
        .unwrap()
        .with_holding(holding)
        .unwrap()
}

fn advice(solved: &Advisor, step: usize, holding: f64) -> Advice {
    solved.advise(step, &state(solved, 100.0, holding), AdviceMode::Surrogate)
}

fn gain(advice: &Advice) -> f64 {
    (advice.certainty_equivalent / advice.floor).ln()
}

/// Nested grids by an independent program (`tests/data/costs.json`), good to 0.05 basis points and 0.003 in allocation; the
/// surrogate of two steps is allowed three times as much again.
#[test]
fn values_and_allocations_agree_with_nested_grids() {
    let oracle: Value = serde_json::from_str(include_str!("../data/costs.json")).unwrap();
    let mut compared = 0;
    for case in oracle["cases"].as_array().unwrap() {
        let utility = match case["utility"].as_str().unwrap() {
            "log" => json!({ "kind": "log" }),
            kind => json!({ "kind": kind, "risk_aversion": case["risk_aversion"] }),
        };
        let solved = crate::support::policies::advisor(json!({
            "problem": { "horizon": case["horizon"], "rate_per_step": case["rate_per_step"], "utility": utility,
                "trading_cost": case["trading_cost"], "history": case["history"],
                "radius": { "rule": "root_n", "kappa": case["radius_times_sqrt_sample_size"] } },
            "design": { "count": 400 } }));
        for expected in case["holdings"].as_array().unwrap() {
            let advice = advice(&solved, 0, expected["holding"].as_f64().unwrap());
            let error = gain(&advice) - expected["log_certainty_equivalent_over_floor"].as_f64().unwrap();
            let off = advice.allocation - expected["allocation"].as_f64().unwrap();
            assert!((BASIS_POINTS * error).abs() < 0.2 && off.abs() < 0.01, "{case} {expected}: {error:e} {off:e}");
            compared += 1;
        }
    }
    assert_eq!(compared, 48);
}

/// Three investors of known law over 240 months, from two independent programs on share grids of 0.00125 and 0.000625 that
/// agree to 0.001: drift, volatility, rate, risk aversion, cost; bands of the first month, of 12 months left, of the last
/// month; certainty equivalent a year, begun at the optimum without cost.
#[test]
fn twenty_years_of_months_agree_with_share_grids() {
    for (mu, sigma, rf, eta, cost, bands, worth) in [
        (0.08, 0.16, 0.02, 4.0, 0.010, [[0.531, 0.641], [0.484, 0.688], [0.0, 1.0]], 1.038_117),
        (0.08, 0.16, 0.02, 4.0, 0.001, [[0.565, 0.608], [0.565, 0.608], [0.469, 0.704]], 1.038_250),
        (0.06, 0.16, 0.02, 3.0, 0.005, [[0.474, 0.569], [0.450, 0.591], [0.0, 1.0]], 1.030_776),
    ] {
        let rate = (rf / 12.0_f64).exp_m1();
        let law = json!({ "weight": 1.0, "mean": (mu - 0.5 * sigma * sigma) / 12.0, "variance": sigma * sigma / 12.0 });
        let solved = crate::support::policies::advisor(json!({
            "problem": { "framework": "known_law", "horizon": 240, "rate_per_step": rate, "trading_cost": cost,
                "utility": { "kind": "power", "risk_aversion": eta }, "history": [0.01, -0.01],
                "law": { "kind": "gaussian_mixture", "components": [law] } } }));
        let merton = (mu - rf) / (eta * sigma * sigma);
        for (step, expected) in [0, 228, 239].into_iter().zip(bands) {
            let band: [f64; 2] = advice(&solved, step, merton).band.into();
            let close = band.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 0.005);
            assert!(close, "cost {cost}, step {step}: {band:?} {expected:?}");
        }
        let yearly = (advice(&solved, 0, merton).certainty_equivalent / 100.0).powf(1.0 / 20.0);
        assert!((yearly - worth).abs() < 1e-5, "cost {cost}: {yearly} {worth}");
    }
}

fn of_cost(cost: f64, utility: Value) -> Advisor {
    crate::support::policies::advisor(json!({
        "problem": { "horizon": 2, "rate_per_step": 0.002, "history": HISTORY, "utility": utility, "trading_cost": cost,
            "radius": { "rule": "root_n", "kappa": 0.01 } },
        "design": { "count": 160 } }))
}

fn utilities() -> [Value; 3] {
    [
        json!({ "kind": "power", "risk_aversion": 8.0 }),
        json!({ "kind": "log" }),
        json!({ "kind": "exponential", "risk_aversion": 0.08 }),
    ]
}

#[test]
fn a_cost_never_raises_the_value_and_widens_the_band() {
    for utility in utilities() {
        let policies = [0.0, 0.0002, 0.002, 0.02].map(|cost| of_cost(cost, utility.clone()));
        for holding in [0.0, 0.3, 0.6, 1.0] {
            let advices = policies.each_ref().map(|solved| advice(solved, 0, holding));
            for pair in advices.windows(2) {
                // Rounding, and the surrogate of the second step: a twentieth of a basis point.
                let grown = pair[1].certainty_equivalent / pair[0].certainty_equivalent - 1.0;
                assert!(grown < 5e-6, "{utility} {holding}: a cost raises the value by {grown:e}");
                assert!(pair[1].band.low <= pair[0].band.low + 1e-3, "{utility} {holding}: {pair:?}");
                assert!(pair[1].band.high >= pair[0].band.high - 1e-3, "{utility} {holding}: {pair:?}");
            }
            let [free, cheap, ..] = advices;
            let width = cheap.band.high - cheap.band.low;
            assert!(free.band.low == free.band.high && width < 0.1, "{utility}: {free:?} {cheap:?}");
        }
    }
}

#[test]
fn inside_the_band_nothing_is_traded_and_from_outside_no_more_than_to_its_nearer_end() {
    let mut between = 0;
    for utility in utilities() {
        let solved = of_cost(0.01, utility.clone());
        let first = advice(&solved, 0, 0.5);
        between += usize::from(first.band.low > 0.01 && first.band.high < 0.99);
        for index in 0..=20 {
            let holding = 0.05 * f64::from(index);
            let Advice { allocation, band, trade, .. } = advice(&solved, 0, holding);
            assert_eq!((allocation, trade), (holding.max(band.low).min(band.high), allocation - holding));
            // The two ends hardly depend on what is held.
            assert!((band.low - first.band.low).abs() < 0.01 && (band.high - first.band.high).abs() < 0.01);
        }
    }
    assert_eq!(between, 2, "log utility holds all there is; of the others the band lies between the bounds");
}

/// An action is worth most, tried one by one, at the end of the band to which the holding is brought.
#[test]
fn no_other_action_is_worth_more_than_the_one_advised() {
    use ballast::control::bellman::BellmanStep;
    use ballast::control::bellman::next_value::NextValue;

    for utility in utilities() {
        let solved = of_cost(0.01, utility.clone());
        let problem = solved.policy().problem(Default::default());
        let next = NextValue::new(solved.specification(), 1, Some(&solved.policy().steps()[1].solution));
        let step = BellmanStep { problem: &problem, step: 0, next: &next };
        for holding in [0.0, 0.2, 0.45, 0.7, 1.0] {
            let state = state(&solved, 100.0, holding);
            let best = step.solve(&state);
            for index in 0..=40 {
                let other = step.price(&state, 0.025 * f64::from(index)).floor_gain;
                // The action is found to 1e-7, and the worst law of either to the grid's own error.
                assert!(other <= best.floor_gain + 1e-7, "{utility} {holding}: {index} is worth {other} of {best:?}");
            }
        }
    }
}

/// Selling all at once is feasible whatever the law: no certainty equivalent is below it, and the floor says what it leaves.
#[test]
fn the_floor_is_selling_everything_and_never_undercut() {
    for utility in utilities() {
        let solved = of_cost(0.02, utility);
        for holding in [0.0, 0.4, 1.0] {
            let advice = advice(&solved, 0, holding);
            let floor = 100.0 * (1.0 - 0.02 * holding) * 1.002_f64.powi(2);
            assert!((advice.floor - floor).abs() < 1e-12 * floor);
            assert!(advice.certainty_equivalent >= advice.floor);
        }
    }
}

/// The policy answers any holding as a step that is solved anew, also a holding above the highest action.
#[test]
fn what_is_read_off_the_policy_is_what_is_solved_anew() {
    // Keeping everything looks best in the window of returns that is wide enough for half of it.
    let tempting = json!({ "horizon": 1, "history": HISTORY, "trading_cost": 0.02, "rate_per_step": 0.002,
        "utility": { "kind": "power", "risk_aversion": 2.0 }, "radius": { "rule": "fixed", "radius": 0.003 } });
    let bounded = json!({ "horizon": 2, "rate_per_step": 0.002, "history": HISTORY, "trading_cost": 0.05, "action_interval": [0.0, 0.53],
        "utility": { "kind": "log" }, "radius": { "rule": "fixed", "radius": 0.001 } });
    for (problem, design) in [(tempting, 10), (bounded, 60)] {
        let solved = crate::support::policies::advisor(json!({ "problem": problem, "design": { "count": design } }));
        for index in 0..=20 {
            let state = state(&solved, 100.0, 0.05 * f64::from(index));
            let [read, anew] = [AdviceMode::Surrogate, AdviceMode::Resolve].map(|mode| solved.advise(0, &state, mode));
            let error = BASIS_POINTS * (gain(&read) - gain(&anew));
            // The value at 257 holdings, the ends of the band at one of them.
            let off = read.allocation - anew.allocation;
            assert!(error.abs() < 0.1 && off.abs() < 0.01, "{index}: {error} bp, {off} of {read:?} {anew:?}");
        }
    }
}

#[test]
fn no_cost_is_the_problem_without_one() {
    let mut request = json!({ "problem": { "horizon": 2, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": HISTORY }, "design": { "count": 20 } });
    let without = crate::support::policies::train(request.clone()).to_json().unwrap();
    request["problem"]["trading_cost"] = json!(0.0);
    assert!(crate::support::policies::train(request).to_json().unwrap() == without);
}
