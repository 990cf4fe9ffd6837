//! The robust dynamic programme against independent solutions, and its properties.

use std::sync::atomic::AtomicBool;

use crate::support::policies::{advisor, specification, train};
use ballast::control::bellman::problem::Problem;
use ballast::control::cache::Cache;
use ballast::control::error::TrainError;
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::problem::utility::utility;
use ballast::control::progress::Watch;
use ballast::control::request::learning::Learning;
use ballast::control::solved_step::StepSolution;
use ballast::control::training::Training;
use serde_json::{Value, json};

fn utility_of(case: &Value) -> Value {
    json!({ "kind": case["utility"], "risk_aversion": case["risk_aversion"] })
}

fn check_last_step(case: &Value, history: &Value) {
    let solved = advisor(json!({ "problem": {
        "horizon": 1, "rate_per_step": case["rate_per_step"], "initial_wealth": case["wealth"],
        "utility": utility_of(case), "radius": { "rule": "fixed", "radius": case["radius"] }, "history": history } }));
    let state = solved.initial_state(None, None).unwrap();
    let advice = solved.advise(0, &state, AdviceMode::Surrogate);
    let expected = case["certainty_equivalent"].as_f64().unwrap();
    let error = (advice.certainty_equivalent / expected).ln();
    // The tolerance; the oracle states 1e-7.
    assert!(error.abs() < 1e-6, "{case}: {} against {expected}, log error {error:e}", advice.certainty_equivalent);
    let apart = (advice.allocation - case["allocation"].as_f64().unwrap()).abs();
    // A flat optimum has the same certainty equivalent at another allocation.
    assert!(apart < 0.005 || error.abs() < 1e-8, "{case}: allocation {}", advice.allocation);
}

#[test]
fn the_last_step_agrees_with_a_direct_solve() {
    let oracle: Value = serde_json::from_str(include_str!("../data/last_step.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 72);
    for case in cases {
        check_last_step(case, &case["history"]);
    }
}

/// Log-returns of the 240 months before `first`.
fn market_history(first: &str) -> Vec<f64> {
    let rows: Vec<&str> = include_str!("../../data/us_market_monthly.csv").lines().skip(1).collect();
    let index = rows.iter().position(|row| row.starts_with(first)).unwrap();
    let log_return = |row: &&str| (1.0 + row.split(',').nth(1).unwrap().parse::<f64>().unwrap()).ln();
    rows[index - 240..index].iter().map(log_return).collect()
}

#[test]
fn the_last_step_on_real_returns_agrees_with_a_direct_solve() {
    let oracle: Value = serde_json::from_str(include_str!("../data/us_market.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 28);
    for case in cases {
        let history = market_history(case["first_period"].as_str().unwrap());
        check_last_step(case, &json!(history));
    }
}

#[test]
fn the_bridge_quantile_agrees_with_a_million_paths() {
    use ballast::numerics::bridge::paths::AbsoluteBridges;
    use ballast::numerics::law::empirical::EmpiricalDistribution;
    let oracle: Value = serde_json::from_str(include_str!("../data/bridge.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let sample: Vec<f64> = serde_json::from_value(case["sample"].clone()).unwrap();
        let law = EmpiricalDistribution::new(&sample);
        let bridges = AbsoluteBridges::simulate(sample.len(), 50_000, 11);
        for row in case["quantiles"].as_array().unwrap() {
            let found = bridges.bridge_quantile_with_error(&law, row["alpha"].as_f64().unwrap());
            let allowed = 4.0 * (found.standard_error + row["standard_error"].as_f64().unwrap());
            assert!((found.value - row["quantile"].as_f64().unwrap()).abs() < allowed, "{row} {found:?}");
            let exact = bridges.exact(&law).quantile(1.0 - row["alpha"].as_f64().unwrap());
            let apart = (exact - row["quantile"].as_f64().unwrap()).abs();
            assert!(apart < 4.0 * row["standard_error"].as_f64().unwrap(), "{row} {exact}");
        }
    }
}

/// `weighted_bridge.json`: returns whose weights halve every `half_life` of them, through the radius that a policy is given.
#[test]
fn the_bridge_quantile_of_decaying_weights_agrees_with_a_million_paths() {
    let oracle: Value = serde_json::from_str(include_str!("../data/weighted_bridge.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let number = |field: &str| case[field].as_f64().unwrap();
        let request = json!({ "problem": { "horizon": 1, "rate_per_step": 0.0, "history": case["returns"],
            "learning": { "kind": "decay", "half_life": case["half_life"] },
            "radius": { "rule": "bridge", "alpha": case["alpha"] } } });
        let problem = Problem::new(&specification(request).resolved(&Cache::default()));
        let history = &problem.specification.problem.history;
        let law = problem.specification.problem.learning.law(history);
        assert!((law.effective_size() / number("effective_size") - 1.0).abs() < 1e-13);
        let measure = problem.laws.measure(&law);
        let found = measure.quantile.unwrap();
        // Beside the error of the million, what is interpolated between the times of the bridges: a thousandth.
        let allowed = 4.0 * number("standard_error") + 1e-3 * found;
        assert!((found - number("quantile")).abs() < allowed, "{found} against {}", number("quantile"));
        // An error of one in a hundred would show.
        assert!(allowed < 0.01 * found, "{allowed}");
        assert!((measure.radius / (found / number("effective_size").sqrt()) - 1.0).abs() < 1e-13);
    }
}

#[test]
fn whole_horizons_agree_with_nested_grids() {
    let oracle: Value = serde_json::from_str(include_str!("../data/horizon.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 13);
    for case in cases {
        let adaptive = case["framework"] == "adaptive";
        let radius = if adaptive {
            json!({ "rule": "root_n", "kappa": case["radius_times_sqrt_sample_size"] })
        } else {
            json!({ "rule": "fixed", "radius": case["radius"] })
        };
        let count = if adaptive { 500 } else { 200 };
        let solved = advisor(json!({ "problem": {
            "framework": case["framework"], "horizon": case["horizon"], "rate_per_step": case["rate_per_step"],
            "initial_wealth": case["wealth"], "utility": utility_of(case), "radius": radius,
            "history": case["history"] }, "design": { "count": count } }));
        let state = solved.initial_state(None, None).unwrap();
        let advice = solved.advise(0, &state, AdviceMode::Surrogate);
        let expected = case["log_certainty_equivalent_over_bank"].as_f64().unwrap();
        let error = (advice.certainty_equivalent / advice.floor).ln() - expected;
        // Over two and three periods 0.02 basis points, as `ballast-lab bench horizons` finds with 1,000 points, and as much again for 500
        // (20 points leave 0.3). Over ten, half a basis point: that is what the references claim for themselves, and what
        // is left there, 0.25, is the same with 200 points and with 1,000.
        let allowed = if case["horizon"].as_u64().unwrap() < 10 { 4e-6 } else { 5e-5 };
        println!("{} T {} error {error:e} allocation {}", case["framework"], case["horizon"], advice.allocation);
        assert!(error.abs() < allowed, "{case}: error {error:e}");
        let apart = (advice.allocation - case["allocation"].as_f64().unwrap()).abs();
        assert!(apart < 0.03, "{case}: allocation {}", advice.allocation);
    }
}

/// Twenty returns, the first of the horizon oracle's.
fn twenty_returns() -> Vec<f64> {
    let oracle: Value = serde_json::from_str(include_str!("../data/horizon.json")).unwrap();
    serde_json::from_value(oracle["cases"][0]["history"].clone()).unwrap()
}

#[test]
fn the_known_law_of_the_paper_is_worth_67_36() {
    let solved = advisor(json!({ "problem": {
        "framework": "known_law", "horizon": 10, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": twenty_returns(),
        "law": { "kind": "gaussian_mixture", "components": [
            { "weight": 0.4, "mean": 0.006, "variance": 0.016 },
            { "weight": 0.6, "mean": 0.016, "variance": 0.00625 } ] } } }));
    let state = solved.initial_state(None, None).unwrap();
    let advice = solved.advise(0, &state, AdviceMode::Surrogate);
    let value = utility(solved.specification().problem.utility, advice.certainty_equivalent);
    assert!((value - 67.3600).abs() < 0.003, "{value}");
    assert!(advice.allocation > 0.99);
}

fn small(radius: Value, framework: &str) -> Value {
    json!({ "problem": { "framework": framework, "horizon": 3, "radius": radius, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": twenty_returns() },
            "design": { "count": 60 } })
}

#[test]
fn radius_zero_is_plug_in_and_a_wider_ball_is_never_worth_more() {
    let value = |radius: f64| {
        let solved = advisor(small(json!({ "rule": "fixed", "radius": radius }), "adaptive"));
        let state = solved.initial_state(None, None).unwrap();
        let advice = solved.advise(0, &state, AdviceMode::Surrogate);
        assert!(advice.certainty_equivalent >= advice.floor);
        advice.certainty_equivalent
    };
    let plug_in = advisor(small(json!({ "rule": "fixed", "radius": 0.3 }), "plug_in"));
    let state = plug_in.initial_state(None, None).unwrap();
    let values = [0.0, 0.005, 0.01, 0.02, 0.04, 0.2].map(value);
    assert_eq!(values[0], plug_in.advise(0, &state, AdviceMode::Surrogate).certainty_equivalent);
    assert!(values.windows(2).all(|pair| pair[1] <= pair[0]), "{values:?}");
}

#[test]
fn the_order_of_the_history_changes_nothing() {
    let mut reversed = small(json!({ "rule": "bridge", "alpha": 0.5, "paths": 200 }), "adaptive");
    let forward = advisor(reversed.clone());
    let mut history = twenty_returns();
    history.reverse();
    reversed["problem"]["history"] = json!(history);
    let reversed = advisor(reversed);
    for advisor in [&forward, &reversed] {
        let mut wide = twenty_returns();
        let state = |history: &[f64]| advisor.initial_state(Some(history), Some(100.0)).unwrap();
        let straight = advisor.advise(1, &state(&wide), AdviceMode::Resolve);
        wide.reverse();
        assert_eq!(straight, advisor.advise(1, &state(&wide), AdviceMode::Resolve));
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads_and_through_json() {
    let mut request = small(json!({ "rule": "bridge", "alpha": 0.5, "paths": 200 }), "adaptive");
    request["design"]["initial_laws"] = json!("resampled");
    let on = |threads: usize, request: &Value| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| train(request.clone()).to_json().unwrap())
    };
    let one = on(1, &request);
    assert!(one == on(2, &request) && one == on(4, &request), "the bytes differ between thread counts");
    assert!(Policy::from_json(&one).unwrap().to_json().unwrap() == one, "the bytes change through JSON");
    request["seed"] = json!(2);
    assert!(one != on(1, &request), "another seed gives the same bytes");
}

#[test]
fn values_stay_above_the_floor_and_actions_in_the_interval_everywhere() {
    for target in ["floor_gain", "value"] {
        for (features, kind) in [("standardized", "exponential"), ("raw_moments", "power"), ("standardized", "log")] {
            let utility = match kind {
                "exponential" => json!({ "kind": kind, "risk_aversion": 0.01 }),
                "power" => json!({ "kind": kind, "risk_aversion": 3.0 }),
                _ => json!({ "kind": kind }),
            };
            let solved = advisor(
                json!({ "problem": { "horizon": 2, "utility": utility, "rate_per_step": 0.002, "history": twenty_returns(),
                "radius": { "rule": "bridge", "alpha": 0.9, "paths": 200, "scale": 0.3 } },
                "design": { "count": 40 }, "surrogate": { "target": target, "features": features } }),
            );
            for (wealth, shift) in [(100.0, 0.0), (3.0, 0.4), (2000.0, -0.4), (100.0, 2.0)] {
                let history: Vec<f64> = twenty_returns().iter().map(|z| z * (1.0 + shift) + shift).collect();
                let state = State::new(&history, wealth, Learning::default()).unwrap();
                for step in 0..2 {
                    let advice = solved.advise(step, &state, AdviceMode::Surrogate);
                    assert!(advice.certainty_equivalent >= advice.floor, "{target} {features} {kind} {advice:?}");
                    assert!((0.0..=1.0).contains(&advice.allocation));
                }
            }
        }
    }
}

#[test]
fn a_training_asked_to_stop_solves_nothing() {
    let training = Training::new(&specification(json!({"problem": {"rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": [0.01, -0.02, 0.03]}})))
    .unwrap();
    let watch = Watch { stop: &AtomicBool::new(true), progress: &|_| {} };
    assert!(matches!(training.solve_step(9, None, &watch), Err(TrainError::Stopped)));
}

#[test]
fn a_checkpoint_of_another_format_is_not_gone_on_from() {
    let specification = specification(json!({ "problem": { "horizon": 2, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": twenty_returns() },
        "design": { "count": 12, "initial_laws": "resampled" } }));
    let training = Training::new(&specification).unwrap();
    let watch = Watch::unwatched();
    let solved = training.solve_step(1, None, &watch).unwrap();
    let kept = solved.to_checkpoint().unwrap();
    assert_eq!(StepSolution::from_checkpoint(&kept), Some(solved.clone()));
    let mut other: Value = serde_json::from_slice(&kept).unwrap();
    other["format"] = json!("ballast-policy-0");
    assert_eq!(StepSolution::from_checkpoint(other.to_string().as_bytes()), None);
    assert_eq!(StepSolution::from_checkpoint(&serde_json::to_vec(&solved).unwrap()), None, "it names no format");
}

#[test]
fn a_known_law_without_a_mean_of_its_exponential_is_solved_within_the_returns_accepted() {
    let law = json!({ "kind": "student_t", "location": 0.0, "scale": 1.0, "degrees_of_freedom": 2.1 });
    for utility in [json!({ "kind": "log" }), json!({ "kind": "power", "risk_aversion": 5.0 })] {
        let solved = advisor(json!({
            "problem": { "horizon": 2, "framework": "known_law", "law": law, "utility": utility, "rate_per_step": 0.002, "history": [0.01, -0.02] },
            "design": { "count": 20 } }));
        let state = solved.initial_state(None, None).unwrap();
        for mode in [AdviceMode::Surrogate, AdviceMode::Resolve] {
            let advice = solved.advise(0, &state, mode);
            assert!((0.0..=1.0).contains(&advice.allocation), "{advice:?}");
            assert!(
                advice.certainty_equivalent >= advice.floor && advice.certainty_equivalent.is_finite(),
                "{advice:?}"
            );
        }
    }
}

#[test]
fn no_import_shows_more_than_the_best_return_earns_in_every_period() {
    let history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008];
    let policy = train(json!({ "problem": { "horizon": 3, "rate_per_step": 0.002, "history": history,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 } }, "design": { "count": 20 } }));
    let mut claims: Value = serde_json::from_slice(&policy.to_json().unwrap()).unwrap();
    for step in [1, 2] {
        let solution = &mut claims["steps"][step]["solution"];
        solution["value"]["offset"] = json!(1e30);
        solution["value"]["scale"] = json!(1e30);
        solution["deviation_limit"] = json!(1e30);
    }
    let claiming = Advisor::new(Policy::from_json(&serde_json::to_vec(&claims).unwrap()).unwrap());
    let mut state = claiming.initial_state(None, None).unwrap();
    for step in 0..3 {
        for mode in [AdviceMode::Surrogate, AdviceMode::Resolve] {
            let advice = claiming.advise(step, &state, mode);
            let most = advice.floor * (0.033_f64.exp() / 1.002).powi(3 - step as i32);
            assert!(advice.certainty_equivalent <= most * (1.0 + 1e-12), "{step} {mode:?}: {advice:?}, at most {most}");
            assert!(advice.surrogate_sd < 1.0, "{advice:?}");
        }
        state = claiming.advance(step, &state, &PeriodOutcome::of(0.5, 0.01));
    }
}
