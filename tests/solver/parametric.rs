//! The parametric frameworks against independent solutions, and their properties.

use crate::support::App;
use crate::support::policies::{advisor, specification, train};
use crate::support::values::number;
use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::bellman::solution::Adversary;
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::policy::what_if::{Hypothesis, HypotheticalRadius};
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::request::learning::Learning;
use serde_json::{Value, json};

const FRAMEWORKS: [&str; 2] = ["parametric_static", "parametric_adaptive"];

/// The cases of the reference with this horizon and framework, each with its history in place.
fn cases(list: &str, count: usize) -> Vec<Value> {
    let oracle: Value = serde_json::from_str(include_str!("../data/parametric.json")).unwrap();
    let mut cases = oracle[list].as_array().unwrap().clone();
    assert_eq!(cases.len(), count);
    for case in &mut cases {
        case["history"] = oracle["histories"][case["history"].as_str().unwrap()].clone();
    }
    cases
}

fn request(case: &Value, framework: &str, horizon: usize) -> Value {
    let utility = match &case["risk_aversion"] {
        Value::Null => json!({ "kind": case["utility"] }),
        risk_aversion => json!({ "kind": case["utility"], "risk_aversion": risk_aversion }),
    };
    json!({ "problem": {
        "framework": framework, "horizon": horizon, "rate_per_step": case["rate_per_step"],
        "initial_wealth": case["wealth"], "utility": utility,
        "radius": { "rule": "chi_square", "alpha": case["alpha"] }, "history": case["history"] } })
}

/// Log certainty equivalent over the bank and allocation at the start.
fn start(advisor: &Advisor) -> (f64, f64) {
    let advice = advisor.advise(0, &advisor.initial_state(None, None).unwrap(), AdviceMode::Surrogate);
    ((advice.certainty_equivalent / advice.floor).ln(), advice.allocation)
}

fn check_start(case: &Value, (gain, allocation): (f64, f64), gain_tolerance: f64, allocation_tolerance: f64) {
    let error = gain - number(&case["log_gain"]);
    assert!(error.abs() < gain_tolerance, "{case}: log gain {gain}, error {error:e}");
    let apart = allocation - number(&case["allocation"]);
    assert!(apart.abs() < allocation_tolerance, "{case}: allocation {allocation}, {apart:e} apart");
}

#[test]
fn one_step_agrees_with_a_search_of_the_whole_region() {
    let mut inside = 0;
    for case in cases("one_step", 120) {
        for framework in FRAMEWORKS {
            let solved = advisor(request(&case, framework, 1));
            let found = start(&solved);
            // Both optima are flat: the allocation is good to the root of the value's error.
            check_start(&case, found, 1e-9, 2e-4);
            inside += usize::from(found.1 > 0.0 && found.1 < 1.0);
            let (_, worst) = solved.explain(0, &solved.initial_state(None, None).unwrap());
            let normal = worst.normal.unwrap();
            assert!((normal.mean - number(&case["worst_mean"])).abs() < 2e-5, "{case} {normal:?}");
            assert!((normal.variance - number(&case["worst_variance"])).abs() < 2e-5, "{case} {normal:?}");
        }
    }
    assert!(inside > 80, "only {inside} allocations lie inside: the test shows little");
}

/// All in while prices fall is worse than the bank under every law of the region, and under the worst still worse than under
/// the estimate.
#[test]
fn a_loss_has_a_worst_law_too() {
    let history: Vec<f64> = (0..20).map(|k| -0.04 + 0.02 * (f64::from(k * 7 % 20) / 10.0 - 0.95)).collect();
    for framework in FRAMEWORKS {
        let specification = specification(json!({ "problem": { "framework": framework, "horizon": 1,
            "rate_per_step": 0.002, "utility": { "kind": "log" }, "radius": { "rule": "chi_square", "alpha": 0.1 },
            "history": history } }));
        let problem = Problem::new(&specification);
        let state = State::new(&history, 100.0, Learning::default()).unwrap();
        let priced = BellmanStep { problem: &problem, step: 0, next: &NextValue::Terminal }.price(&state, 1.0);
        let Adversary::Normal { worst, estimate } = priced.adversary else { panic!("{priced:?}") };
        assert!(priced.floor_gain < -0.04 && worst.mean < estimate.mean - 0.001, "{priced:?}");
    }
}

#[test]
fn a_frozen_region_and_a_homogeneous_utility_repeat_the_same_step() {
    let cases = cases("one_step", 120);
    let homogeneous: Vec<&Value> = cases.iter().filter(|case| case["utility"] != "exponential").step_by(5).collect();
    assert_eq!(homogeneous.len(), 15);
    for case in homogeneous {
        let (gain, allocation) = start(&advisor(request(case, "parametric_static", 5)));
        check_start(case, (gain / 5.0, allocation), 1e-9, 2e-4);
    }
}

#[test]
fn two_frozen_steps_agree_with_nested_grids() {
    for case in cases("two_steps_static", 3) {
        let found = start(&advisor(request(&case, "parametric_static", 2)));
        println!("static error {:e} {:e}", found.0 - number(&case["log_gain"]), found.1 - number(&case["allocation"]));
        check_start(&case, found, 1e-6, 1e-3);
    }
}

/// The step before the last over the exact value of the last, without a surrogate.
fn exact_first_of_two(request: Value) -> (f64, f64) {
    let specification = specification(request);
    let problem = Problem::new(&specification);
    let last = Problem::new(&specification);
    let gain = move |state: &State| {
        vec![BellmanStep { problem: &last, step: 1, next: &NextValue::Terminal }.solve(state).floor_gain]
    };
    let state =
        State::new(&specification.problem.history, specification.problem.initial_wealth, Learning::default()).unwrap();
    let next = NextValue::Exact(problem.holdings(1), Box::new(gain));
    let found = BellmanStep { problem: &problem, step: 0, next: &next }.solve(&state);
    (found.floor_gain, found.action)
}

#[test]
fn two_learning_steps_agree_with_nested_grids() {
    for case in cases("two_steps_adaptive", 8) {
        let exact = exact_first_of_two(request(&case, "parametric_adaptive", 2));
        println!("exact error {:e} {:e}", exact.0 - number(&case["log_gain"]), exact.1 - number(&case["allocation"]));
        check_start(&case, exact, 5e-7, 1e-4);
        let mut request = request(&case, "parametric_adaptive", 2);
        request["design"] = json!({ "count": 200 });
        let trained = start(&advisor(request));
        println!(
            "trained error {:e} {:e}",
            trained.0 - number(&case["log_gain"]),
            trained.1 - number(&case["allocation"])
        );
        check_start(&case, trained, 5e-6, 1e-3);
    }
}

const HISTORY: [f64; 12] = [0.061, -0.034, 0.082, 0.043, -0.028, 0.017, 0.051, 0.094, -0.012, 0.036, 0.005, 0.077];

fn small(framework: &str, alpha: f64) -> Value {
    json!({
        "problem": { "framework": framework, "horizon": 3, "rate_per_step": 0.002, "history": HISTORY,
                     "utility": { "kind": "exponential", "risk_aversion": 0.3 },
                     "radius": { "rule": "chi_square", "alpha": alpha } },
        "design": { "count": 60 }
    })
}

fn mean_and_variance(sample: &[f64]) -> (f64, f64) {
    let size = sample.len() as f64;
    let mean = sample.iter().sum::<f64>() / size;
    (mean, sample.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / size)
}

#[test]
fn a_region_shrunk_to_a_point_is_the_known_normal_law() {
    let (mean, variance) = mean_and_variance(&HISTORY);
    for horizon in [1, 3] {
        let mut point = small("parametric_static", 1.0);
        point["problem"]["horizon"] = json!(horizon);
        let mut known = point.clone();
        known["problem"]["framework"] = json!("known_law");
        known["problem"].as_object_mut().unwrap().remove("radius");
        known["problem"]["law"] = json!({ "kind": "gaussian_mixture",
            "components": [{ "weight": 1.0, "mean": mean, "variance": variance }] });
        let (point, known) = (start(&advisor(point)), start(&advisor(known)));
        // One step prices the same quadrature; more of them fit surrogates to two designs of wealths.
        let (gain, allocation) = if horizon == 1 { (1e-14, 1e-5) } else { (1e-7, 1e-3) };
        assert!((point.0 - known.0).abs() < gain, "horizon {horizon}: {point:?} {known:?}");
        assert!((point.1 - known.1).abs() < allocation, "horizon {horizon}: {point:?} {known:?}");
        assert!(point.1 > 0.1 && point.1 < 0.9, "{point:?}");
    }
}

#[test]
fn a_wider_region_is_never_worth_more() {
    for framework in FRAMEWORKS {
        let gains = [1.0, 0.9, 0.5, 0.2, 0.1, 0.01].map(|alpha| start(&advisor(small(framework, alpha))).0);
        assert!(gains.windows(2).all(|pair| pair[1] <= pair[0]), "{framework}: {gains:?}");
        assert!(gains[0] > 1e-3 && gains.iter().all(|gain| *gain >= 0.0), "{framework}: {gains:?}");
    }
}

#[test]
fn the_order_of_returns_and_the_way_they_arrive_change_nothing() {
    for framework in FRAMEWORKS {
        let forward = advisor(small(framework, 0.5));
        let backward: Vec<f64> = HISTORY.iter().rev().copied().collect();
        if framework == "parametric_static" {
            let mut reversed = small(framework, 0.5);
            reversed["problem"]["history"] = json!(backward);
            assert_eq!(start(&advisor(reversed)), start(&forward));
            continue;
        }
        let mut pushed = forward.initial_state(Some(&HISTORY[..10]), Some(97.0)).unwrap();
        for (step, &log_return) in HISTORY[10..].iter().enumerate() {
            pushed = forward.advance(step, &pushed, &PeriodOutcome::of(0.0, log_return));
        }
        pushed.wealth = 97.0;
        let whole = forward.initial_state(Some(&backward), Some(97.0)).unwrap();
        assert_eq!(forward.advise(2, &pushed, AdviceMode::Resolve), forward.advise(2, &whole, AdviceMode::Resolve));
        assert_eq!(forward.uncertainty(&pushed), forward.uncertainty(&whole));
    }
}

#[test]
fn the_region_of_the_answers_is_that_of_the_returns_seen() {
    let frozen = advisor(small("parametric_static", 0.1));
    let learning = advisor(small("parametric_adaptive", 0.1));
    let radius = |size: f64| (-2.0 * 0.1_f64.ln() / size).sqrt();
    for (advisor, last) in [(&frozen, 12.0), (&learning, 13.0)] {
        let first = advisor.initial_state(None, None).unwrap();
        let second = advisor.advance(0, &first, &PeriodOutcome::of(0.3, 0.02));
        assert_eq!(advisor.advise(0, &first, AdviceMode::Surrogate).radius, radius(12.0));
        let advice = advisor.advise(1, &second, AdviceMode::Surrogate);
        assert_eq!((advice.radius, advice.sample_size), (radius(last), 13));
        let normal = advisor.explain(1, &second).1.normal.unwrap();
        let seen: Vec<f64> = HISTORY.iter().copied().chain((last > 12.0).then_some(0.02)).collect();
        let (mean, variance) = mean_and_variance(&seen);
        assert!((normal.estimated_mean - mean).abs() < 1e-15 && (normal.estimated_variance - variance).abs() < 1e-15);
        let distance = (normal.mean - mean).powi(2) / variance + (normal.variance / variance - 1.0).powi(2) / 2.0;
        assert!((distance.sqrt() / radius(last) - 1.0).abs() < 1e-9, "the worst law lies on the boundary: {normal:?}");
    }
    assert!(frozen.initial_state(Some(&[0.01, 0.02]), None).is_err());
}

#[test]
fn a_radius_supposed_is_the_radius_of_the_region() {
    for framework in FRAMEWORKS {
        let solved = advisor(small(framework, 0.5));
        let state = solved.initial_state(None, None).unwrap();
        let suppose = |radius: HypotheticalRadius| {
            let hypothesis = Hypothesis { radius: Some(radius), ..Hypothesis::default() };
            let supposed = solved.suppose(2, None, &state, &hypothesis, AdviceMode::Surrogate).unwrap();
            let worst = supposed.worst_case.unwrap();
            let (normal, summary) = (worst.normal.unwrap(), worst.summary().unwrap());
            assert_eq!((summary.mean, summary.standard_deviation), (normal.mean, normal.variance.sqrt()));
            assert_eq!((summary.share_moved, summary.lowest_destination), (None, None));
            (supposed.advice, normal)
        };
        let own = solved.advise(2, &state, AdviceMode::Resolve);
        let (point, at_point) = suppose(HypotheticalRadius::Fixed(0.0));
        let (same, _) = suppose(HypotheticalRadius::Scaled(1.0));
        let (wide, at_wide) = suppose(HypotheticalRadius::Scaled(1.5));
        assert_eq!((same.allocation, same.certainty_equivalent), (own.allocation, own.certainty_equivalent));
        assert!(wide.certainty_equivalent < own.certainty_equivalent, "{framework}");
        assert!(own.certainty_equivalent < point.certainty_equivalent, "{framework}");
        assert_eq!((at_point.mean, at_point.variance), (at_point.estimated_mean, at_point.estimated_variance));
        let (mean, variance) = (at_wide.mean - at_wide.estimated_mean, at_wide.variance / at_wide.estimated_variance);
        let distance = mean.powi(2) / at_wide.estimated_variance + (variance - 1.0).powi(2) / 2.0;
        assert!((distance.sqrt() / (1.5 * own.radius) - 1.0).abs() < 1e-9, "{framework}: {at_wide:?}");
    }
}

#[test]
fn the_multiplier_is_the_utility_lost_per_unit_of_radius() {
    let solved = |alpha: f64| {
        let mut request = small("parametric_adaptive", alpha);
        request["problem"]["horizon"] = json!(1);
        request["problem"]["action_interval"] = json!([0.0, 0.1]);
        request["problem"]["utility"]["risk_aversion"] = json!(0.03);
        let advisor = advisor(request);
        let (advice, worst) = advisor.explain(0, &advisor.initial_state(None, None).unwrap());
        assert_eq!(advice.allocation, 0.1);
        let utility = -(-0.03 * advice.certainty_equivalent).exp_m1() / 0.03;
        (advice.radius, utility, worst.multiplier)
    };
    let (below, middle, above) = (solved(0.5005), solved(0.5), solved(0.4995));
    let slope = (below.1 - above.1) / (above.0 - below.0);
    // A difference over 1e-3 of the radius, of utilities with thirteen digits.
    assert!((middle.2 / slope - 1.0).abs() < 1e-5, "{} against {slope}", middle.2);
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_one_thread_and_on_two() {
    for framework in FRAMEWORKS {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| train(small(framework, 0.5)).to_json().unwrap())
        };
        let one = on(1);
        assert!(one == on(2), "{framework}: the bytes differ between thread counts");
        assert!(
            Policy::from_json(&one).unwrap().to_json().unwrap() == one,
            "{framework}: the bytes change through JSON"
        );
    }
}

#[test]
fn features_are_wealth_mean_and_deviation() {
    let policy = train(small("parametric_adaptive", 0.5));
    let features = &policy.steps()[1].diagnostics.value.as_ref().unwrap().features;
    assert_eq!(*features, ["log_wealth", "mean", "log_standard_deviation"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_live_session_equals_the_simulator_and_tells_the_worst_mean_and_variance() {
    for framework in FRAMEWORKS {
        let mut app = App::start().await;
        app.train(&small(framework, 0.5)).await;
        app.open().await;
        let advisor = Advisor::new(Policy::from_json(&app.export().await).unwrap());
        let returns = [0.0123456789, -0.031, 0.044];
        let advices: Vec<_> = advisor.walk(advisor.initial_state(None, None).unwrap(), &returns).collect();
        let mut state = advisor.initial_state(None, None).unwrap();
        for (index, (advice, log_return)) in advices.iter().zip(returns).enumerate() {
            let (_, action) = app.action().await;
            assert!(advice.allocation > 0.0, "the test must hold something");
            assert_eq!(number(&action["allocation"]), advice.allocation);
            assert_eq!(number(&action["certainty_equivalent"]), advice.certainty_equivalent);
            assert_eq!(number(&action["radius"]), advice.radius);
            let (_, explained) = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await;
            let (_, worst) = advisor.explain(index, &state);
            assert_eq!(explained["worst_case"], json!(worst));
            let (sentence, normal) = (&worst.sentence, worst.normal.unwrap());
            assert!(sentence.contains(&format!("mean log-return of {:.2} %", 100.0 * normal.mean)), "{sentence}");
            assert!(sentence.contains(&format!("variance of {:.2e}", normal.variance)), "{sentence}");
            let (_, observed) = app.observe(index + 1, log_return).await;
            state = advisor.advance(index, &state, &PeriodOutcome::of(advice.allocation, log_return));
            assert_eq!(number(&observed["wealth"]), state.wealth);
            assert_eq!(number(&observed["radius"]), advisor.uncertainty(&state).radius);
            assert_eq!(observed["quantile"], Value::Null);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn other_rules_and_bounds_are_refused_by_name() {
    let app = App::start().await;
    let bounds = json!({ "rule": "between", "min": -1.0, "max": 1.0 });
    for (framework, name, value, field, shown) in [
        ("parametric_static", "radius", json!({ "rule": "bridge" }), "problem.radius.rule", "bridge"),
        ("parametric_adaptive", "radius", json!({ "rule": "root_n", "kappa": 1.0 }), "problem.radius.rule", "root_n"),
        ("parametric_adaptive", "radius", json!({ "rule": "fixed", "radius": 0.0 }), "problem.radius.rule", "fixed"),
        ("adaptive", "radius", json!({ "rule": "chi_square" }), "problem.radius.rule", "chi_square"),
        ("known_law", "radius", json!({ "rule": "chi_square" }), "problem.radius.rule", "chi_square"),
        ("parametric_static", "radius", json!({ "rule": "chi_square", "alpha": 0.0 }), "problem.radius.alpha", "0"),
        ("parametric_static", "support", bounds, "problem.support", "an object"),
    ] {
        let mut request = crate::support::specification(2);
        request["problem"].as_object_mut().unwrap().remove("radius");
        request["problem"]["framework"] = json!(framework);
        request["problem"][name] = value;
        let (status, problem) = app.post("/train", &request).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
        assert_eq!(problem["value"].to_string().trim_matches('"'), shown, "{problem}");
    }
    for framework in FRAMEWORKS {
        let request = json!({ "problem": { "framework": framework, "rate_per_step": 0.002, "history": HISTORY } });
        let completed = json!(specification(request));
        assert_eq!(completed["problem"]["radius"], json!({ "rule": "chi_square", "alpha": 0.1 }));
    }
}
