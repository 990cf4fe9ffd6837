//! The centre of the ball: `problem.centre`.

use crate::support::App;
use crate::support::policies::{advisor, specification, train};
use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::bellman::problem::Problem;
use ballast::control::bellman::solution::RobustSolution;
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::pool::TrainingPool;
use ballast::control::problem::state::State;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::specification::Specification;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::law::volatility::rescaled;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Normal};

const HISTORY: [f64; 10] = [0.021, -0.034, 0.052, 0.043, -0.008, 0.017, 0.029, -0.011, 0.036, -0.019];
const RATE: f64 = 0.002;
const RISK_AVERSION: f64 = 8.0;

fn bridge(scale: f64) -> Value {
    json!({ "rule": "bridge", "alpha": 0.5, "paths": 200, "scale": scale })
}

fn request(horizon: usize, radius: Value, centre: Value) -> Value {
    json!({ "problem": { "horizon": horizon, "rate_per_step": RATE, "history": HISTORY, "radius": radius, "centre": centre,
        "utility": { "kind": "power", "risk_aversion": RISK_AVERSION } }, "design": { "count": 120 } })
}

fn smoothed(bandwidth: f64) -> Value {
    json!({ "kind": "smoothed", "bandwidth": bandwidth })
}

/// Another market, of which two returns are known.
fn mixed(weight: f64) -> Value {
    json!({ "kind": "mixed", "history": [0.07, 0.01], "weight": weight })
}

fn volatility_scaled(half_life: f64) -> Value {
    json!({ "kind": "volatility_scaled", "half_life": half_life })
}

/// The last step, solved at the history.
fn last_step(radius: Value, centre: Value) -> RobustSolution {
    let problem = Problem::new(&specification(request(1, radius, centre)));
    let start = State { wealth: 100.0, holding: 0.0, law: EmpiricalDistribution::new(&HISTORY) };
    BellmanStep { problem: &problem, step: 0, next: &NextValue::Terminal }.solve(&start)
}

#[test]
fn no_bandwidth_and_no_weight_are_the_returns_seen_bit_for_bit_and_other_hashes() {
    let empirical = train(request(3, bridge(0.2), json!({ "kind": "empirical" })));
    let mut plain = request(3, bridge(0.2), Value::Null);
    plain["problem"].as_object_mut().unwrap().remove("centre");
    assert_eq!(train(plain).to_json().unwrap(), empirical.to_json().unwrap(), "empirical is the default");
    let steps = |policy: &Policy| serde_json::to_string(policy.steps()).unwrap();
    for centre in [smoothed(0.0), mixed(0.0)] {
        let policy = train(request(3, bridge(0.2), centre));
        assert_eq!(steps(&policy), steps(&empirical));
        assert_ne!(policy.to_json().unwrap(), empirical.to_json().unwrap());
    }
    for centre in [smoothed(0.01), mixed(5.0)] {
        assert_ne!(steps(&train(request(3, bridge(0.2), centre))), steps(&empirical));
    }
}

#[test]
fn a_policy_of_any_centre_is_the_same_on_one_thread_and_on_two() {
    for centre in [smoothed(0.01), mixed(5.0)] {
        let [one, two] = [1, 2].map(|threads| {
            let pool = TrainingPool::new(threads).unwrap();
            pool.install(|| train(request(2, bridge(0.2), centre.clone()))).to_json().unwrap()
        });
        assert_eq!(one, two, "{centre}");
    }
}

/// Floor gain of a share held until the horizon, from the mean of (growth over the bank's)^(1 - risk aversion).
fn gain(mean_power: f64) -> f64 {
    mean_power.ln() / (1.0 - RISK_AVERSION)
}

/// The paper's formula for the perturbed empirical law: max over gamma of E[ inf_z { v(z) + gamma |z - Z| } ] - gamma radius, Z a
/// return drawn from those seen plus a normal error. The infimum is found on a grid, by a pass over it from either side. An error
/// that is drawn is added to every return seen and taken from it, which makes one draw of a mean. Answers the floor gain and its
/// standard error.
fn drawn(action: f64, radius: f64, bandwidth: f64) -> (f64, f64) {
    const SPACING: f64 = 1e-4;
    let mut generator = stream(7, "test", 0, 0);
    let errors: Vec<f64> = (0..20_000).map(|_| bandwidth * generator.sample::<f64, _>(StandardNormal)).collect();
    let lowest = -1.5;
    // Utility is this power over 1 - risk aversion, which is negative: v is minus the power.
    let payoff: Vec<f64> = (0..20_000)
        .map(|k| lowest + f64::from(k) * SPACING)
        .map(|z| -(1.0 - action + action * z.exp() / (1.0 + RATE)).powf(1.0 - RISK_AVERSION))
        .collect();
    let at = |gamma: f64| {
        let mut envelope = payoff.clone();
        for k in 1..envelope.len() {
            envelope[k] = envelope[k].min(envelope[k - 1] + gamma * SPACING);
        }
        for k in (1..envelope.len()).rev() {
            envelope[k - 1] = envelope[k - 1].min(envelope[k] + gamma * SPACING);
        }
        let value = |z: f64| {
            let place = (z - lowest) / SPACING;
            let (below, share) = (place as usize, place.fract());
            (1.0 - share) * envelope[below] + share * envelope[below + 1]
        };
        let both = |error: &f64| HISTORY.iter().map(|z| value(z + error) + value(z - error)).sum::<f64>();
        let values: Vec<f64> = errors.iter().map(|error| both(error) / (2 * HISTORY.len()) as f64).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean - gamma * radius, (variance / values.len() as f64).sqrt())
    };
    // The dual value is concave in gamma.
    let (mut low, mut high): (f64, f64) = (0.0, 60.0);
    for _ in 0..if radius > 0.0 { 40 } else { 0 } {
        let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(left).0 < at(right).0 { low = left } else { high = right }
    }
    let (value, error) = at(if radius > 0.0 { 0.5 * (low + high) } else { 1e9 });
    (gain(-value), error / -value / (RISK_AVERSION - 1.0))
}

#[test]
fn the_smoothed_ball_agrees_with_draws_from_the_perturbed_empirical_law() {
    for (radius, bandwidth) in [(0.0, 0.02), (0.004, 0.004), (0.004, 0.02), (0.004, 0.05)] {
        let fixed = || json!({ "rule": "fixed", "radius": radius });
        let solution = last_step(fixed(), smoothed(bandwidth));
        let (expected, error) = drawn(solution.action, radius, bandwidth);
        println!("{radius} {bandwidth}: {} at {}, drawn {expected} +- {error}", solution.floor_gain, solution.action);
        assert!(solution.action > 0.02, "{solution:?}");
        // Five nodes in the place of a normal law leave a hundredth of a basis point.
        let off = (solution.floor_gain - expected).abs();
        assert!(off < 4.0 * error + 1e-6, "{} {expected} {error}", solution.floor_gain);
        // The ball around the returns themselves is worth something else.
        let plain = last_step(fixed(), json!({ "kind": "empirical" })).floor_gain;
        assert!(bandwidth < 0.01 || (plain - expected).abs() > 3e-5 + 8.0 * error, "{plain} {expected} {error}");
    }
}

/// An assumed law that is the law of the returns seen, as many of them again, leaves the centre as it is and halves the radius.
#[test]
fn who_assumes_what_was_seen_is_twice_as_sure() {
    let again = json!({ "kind": "mixed", "history": HISTORY, "weight": HISTORY.len() });
    let (mixed, halved) = (last_step(bridge(0.2), again), last_step(bridge(0.1), json!({ "kind": "empirical" })));
    assert!((mixed.action - halved.action).abs() < 1e-6 && mixed.action > 0.05, "{} {}", mixed.action, halved.action);
    assert!((mixed.floor_gain - halved.floor_gain).abs() < 1e-10, "{} {}", mixed.floor_gain, halved.floor_gain);
}

/// An assumed law is what returns at its quantiles are, and where it counts for far more than what was seen, all that counts.
#[test]
fn an_assumed_law_is_what_its_quantiles_are_and_much_of_it_is_the_known_law() {
    let (mean, deviation) = (0.012, 0.04);
    let normal = Normal::new(mean, deviation).unwrap();
    let quantiles: Vec<f64> = (0..4000).map(|k| normal.inverse_cdf((f64::from(k) + 0.5) / 4000.0)).collect();
    let law = json!({ "kind": "gaussian_mixture",
        "components": [{ "weight": 1.0, "mean": mean, "variance": deviation * deviation }] });
    for weight in [5.0, 40.0] {
        let of = |field: &str, value: Value| {
            last_step(bridge(0.1), json!({ "kind": "mixed", field: value, "weight": weight }))
        };
        let (by_law, by_quantiles) = (of("law", law.clone()), of("history", json!(quantiles)));
        println!(
            "{weight}: {} {} and {} {}",
            by_law.action, by_law.floor_gain, by_quantiles.action, by_quantiles.floor_gain
        );
        assert!(by_law.action > 0.05, "{by_law:?}");
        // The outermost quantiles of 4000 leave out some thousandths of a percent of the variance.
        assert!((by_law.action - by_quantiles.action).abs() < 2e-3, "{} {}", by_law.action, by_quantiles.action);
        assert!((by_law.floor_gain - by_quantiles.floor_gain).abs() < 5e-6);
        let plain = last_step(bridge(0.1), json!({ "kind": "empirical" }));
        assert!((by_law.floor_gain - plain.floor_gain).abs() > 1e-4, "{} {}", by_law.floor_gain, plain.floor_gain);
    }
    let mut known = request(1, Value::Null, json!({ "kind": "empirical" }));
    (known["problem"]["framework"], known["problem"]["law"]) = (json!("known_law"), law.clone());
    let problem = Problem::new(&specification(known));
    let start = State { wealth: 100.0, holding: 0.0, law: EmpiricalDistribution::new(&HISTORY) };
    let known = BellmanStep { problem: &problem, step: 0, next: &NextValue::Terminal }.solve(&start);
    // Without a radius: against the smallest one, who is so risk averse holds less, as a crash costs all.
    let none = json!({ "rule": "fixed", "radius": 0.0 });
    let much = last_step(none, json!({ "kind": "mixed", "law": law, "weight": 1e6 }));
    println!("known {} {}, much {} {}", known.action, known.floor_gain, much.action, much.floor_gain);
    assert!((much.action - known.action).abs() < 2e-3, "{} {}", much.action, known.action);
    assert!((much.floor_gain - known.floor_gain).abs() < 2e-6, "{} {}", much.floor_gain, known.floor_gain);
}

#[test]
fn a_mixed_ball_has_the_radius_of_the_share_seen_but_for_a_fixed_one() {
    let weight = 6.0;
    for (rule, shared) in [
        (bridge(0.4), true),
        (json!({ "rule": "calibrated", "alpha": 0.5, "paths": 200 }), true),
        (json!({ "rule": "root_n", "kappa": 0.02 }), true),
        (json!({ "rule": "joint", "alpha": 0.5, "paths": 200 }), true),
        (json!({ "rule": "concentration", "alpha": 0.1 }), true),
        (json!({ "rule": "fixed", "radius": 0.01 }), false),
    ] {
        let of = |centre: Value| {
            let mut request = request(3, rule.clone(), centre);
            request["problem"]["support"] = json!({ "rule": "between", "min": -1.0, "max": 1.0 });
            Problem::new(&specification(request))
        };
        let [plain, mixed] = [json!({ "kind": "empirical" }), mixed(weight)].map(of);
        let mut law = EmpiricalDistribution::new(&HISTORY);
        for seen in [0.03, -0.02] {
            let size = law.sample_size() as f64;
            let share = if shared { size / (size + weight) } else { 1.0 };
            let (plain, mixed) = (plain.laws.measure(&law), mixed.laws.measure(&law));
            assert!((mixed.radius / (plain.radius * share) - 1.0).abs() < 1e-12, "{rule} {plain:?} {mixed:?}");
            assert_eq!(mixed.quantile, plain.quantile, "the quantile is of the returns seen");
            law.push(seen);
        }
    }
}

/// The first of two steps, by the policy and with the second solved at every state that follows: at each of them the centre is made
/// anew of the returns seen by then.
#[test]
fn the_value_of_a_centre_is_that_of_steps_in_each_other() {
    for centre in [smoothed(0.015), mixed(5.0)] {
        for radius in [bridge(0.2), json!({ "rule": "root_n", "kappa": 0.01 })] {
            let solved = advisor(request(2, radius.clone(), centre.clone()));
            let start = solved.initial_state(None, None).unwrap();
            let last = solved.policy().problem(Default::default());
            let gain = move |state: &State| {
                let step = BellmanStep { problem: &last, step: 1, next: &NextValue::Terminal };
                vec![step.solve(state).floor_gain]
            };
            let first = solved.policy().problem(Default::default());
            let next = NextValue::Exact(first.holdings(1), Box::new(gain));
            let exact = BellmanStep { problem: &first, step: 0, next: &next }.solve(&start);
            let advice = solved.advise(0, &start, AdviceMode::Surrogate);
            let found = (advice.certainty_equivalent / advice.floor).ln();
            println!("{centre} {radius} {found:e} {:e} {} {}", exact.floor_gain, advice.allocation, exact.action);
            // A surrogate of 120 points leaves a tenth of a basis point.
            assert!((found - exact.floor_gain).abs() < 1e-5, "{centre} {radius}: {found} {}", exact.floor_gain);
            assert!(exact.floor_gain > 1e-4, "{exact:?}");
        }
    }
}

/// A session answers along its periods, corrected on the way, exported and explained, as the policy does in
/// memory.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_of_any_centre_equals_the_simulator_through_a_correction_and_an_export() {
    for (centre, phrase) in [
        (smoothed(0.01), "of the 10 returns seen, each with a normal error of deviation 0.01, moves"),
        (mixed(5.0), "of the 10 returns seen and the assumed law that counts as 5 more moves"),
    ] {
        let mut app = App::start().await;
        app.train(&request(3, bridge(0.2), centre.clone())).await;
        app.open().await;
        let (_, explained) = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await;
        let sentence = explained["worst_case"]["sentence"].as_str().unwrap();
        assert!(sentence.contains(phrase), "{sentence}");
        let solved = Advisor::new(Policy::from_json(&app.export().await).unwrap());
        let kept: CentreSpecification = serde_json::from_value(centre.clone()).unwrap();
        assert_eq!(solved.specification().problem.centre, kept);

        assert_eq!(app.observe(1, 0.03).await.0, 200);
        let correction =
            json!({ "correction": 1, "period": 1, "log_return": -0.02, "reason": "the index was revised" });
        let corrections = format!("/sessions/{}/corrections", app.session);
        assert_eq!(app.post(&corrections, &correction).await.0, 200);
        let walked: Vec<_> = solved.walk(solved.initial_state(None, None).unwrap(), &[-0.02, 0.01, 0.0]).collect();
        for (period, expected) in (1..).zip(&walked[1..]) {
            let (_, action) = app.action().await;
            for (name, expected) in [("allocation", expected.allocation), ("radius", expected.radius)] {
                assert_eq!(action[name].as_f64(), Some(expected), "{centre} {name} after {period} periods");
            }
            if period == 1 {
                assert_eq!(app.observe(2, 0.01).await.0, 200);
            }
        }
    }
}

/// A static ball, and one for a single period, are those of the record that was brought to one volatility beforehand.
#[test]
fn a_volatility_scaled_centre_is_that_of_the_record_brought_to_one_volatility() {
    for rule in [bridge(0.2), json!({ "rule": "calibrated", "alpha": 0.5, "paths": 200, "scale": 0.2 })] {
        for (framework, horizon) in [("static", 3), ("adaptive", 1), ("plug_in", 1)] {
            let solved = |history: &[f64], centre: Value| {
                let mut body = request(horizon, rule.clone(), centre);
                body["problem"]["framework"] = json!(framework);
                body["problem"]["history"] = json!(history);
                let solved = advisor(body);
                let start = solved.initial_state(None, None).unwrap();
                let (advice, worst) = solved.explain(0, &start);
                (advice.allocation, advice.certainty_equivalent, advice.radius, worst.sentence)
            };
            let found = solved(&HISTORY, volatility_scaled(4.0));
            let expected = solved(&rescaled(&HISTORY, 4.0), json!({ "kind": "empirical" }));
            assert_eq!((found.0, found.1, found.2), (expected.0, expected.1, expected.2), "{framework} {rule}");
            let plain = solved(&HISTORY, json!({ "kind": "empirical" }));
            assert!(found.0 > 0.0 && found.1 != plain.1, "{framework} {found:?} {plain:?}");
            assert!(
                framework != "static" || found.3.contains("returns seen, each rescaled to today's volatility, moves"),
                "{}",
                found.3
            );
        }
    }
}

/// The service advises at once by such a centre, and a session of a static ball goes by it through a correction: the returns
/// recorded are those reported.
#[tokio::test(flavor = "multi_thread")]
async fn a_volatility_scaled_centre_advises_at_once_and_in_a_static_session() {
    let mut app = App::start().await;
    let mut body = request(1, bridge(0.2), volatility_scaled(4.0));
    body.as_object_mut().unwrap().remove("design");
    let (status, advice) = app.post("/advise", &body).await;
    assert_eq!(status, 200, "{advice}");
    let scaled = rescaled(&HISTORY, 4.0);
    body["problem"]["history"] = json!(scaled);
    body["problem"]["centre"] = json!({ "kind": "empirical" });
    let (_, expected) = app.post("/advise", &body).await;
    assert_eq!(advice["allocation"], expected["allocation"]);
    assert_eq!(advice["radius"], expected["radius"]);

    let mut fixed = request(3, bridge(0.2), volatility_scaled(4.0));
    fixed["problem"]["framework"] = json!("static");
    app.train(&fixed).await;
    app.open().await;
    let (_, first) = app.action().await;
    assert_eq!(app.observe(1, 0.03).await.0, 200);
    let correction = json!({ "correction": 1, "period": 1, "log_return": -0.02, "reason": "the index was revised" });
    assert_eq!(app.post(&format!("/sessions/{}/corrections", app.session), &correction).await.0, 200);
    let (_, second) = app.action().await;
    assert_eq!(second["radius"], first["radius"]);
    // One period less to come changes nothing under power utility, to what the search leaves.
    let [held, before] = [&second, &first].map(|action| action["allocation"].as_f64().unwrap());
    assert!((held - before).abs() < 1e-7 && held > 0.05, "{held} {before}");
    assert_eq!(second["sample_size"], json!(HISTORY.len() + 1));
    // Another service that takes the policy as it was exported advises the same, and knows it by the same hash.
    let document: Value = serde_json::from_slice(&app.export().await).unwrap();
    let mut elsewhere = App::start().await;
    let (status, imported) = elsewhere.post("/policies/import", &document).await;
    assert_eq!((status.as_u16(), &imported["policy"]), (201, &json!(app.policy)));
    assert_eq!(document["specification"]["problem"]["centre"], volatility_scaled(4.0));
    elsewhere.policy.clone_from(&app.policy);
    elsewhere.open().await;
    assert_eq!(elsewhere.observe(1, -0.02).await.0, 200);
    let (_, there) = elsewhere.action().await;
    for field in ["allocation", "radius", "certainty_equivalent", "sample_size"] {
        assert_eq!(there[field], second[field], "{field}");
    }
    let mut other = json!({ "policy": app.policy, "history": HISTORY.map(|value| 0.5 * value) });
    let (status, refused) = app.post("/sessions", &other).await;
    assert_eq!((status.as_u16(), refused["field"].as_str()), (422, Some("history")), "{refused}");
    other["history"] = json!(HISTORY);
    assert_eq!(app.post("/sessions", &other).await.0, 201);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_centre_is_refused_by_name_where_it_has_no_meaning() {
    let app = App::start().await;
    let mut known = request(2, Value::Null, smoothed(0.01));
    known["problem"]["framework"] = json!("known_law");
    known["problem"]["law"] =
        json!({ "kind": "student_t", "location": 0.01, "scale": 0.03, "degrees_of_freedom": 5.0 });
    let mut parametric = request(2, json!({ "rule": "chi_square" }), mixed(5.0));
    parametric["problem"]["framework"] = json!("parametric_adaptive");
    let mut decaying = request(2, bridge(0.2), mixed(5.0));
    decaying["problem"]["learning"] = json!({ "kind": "decay", "half_life": 6.0 });
    let learning = request(2, bridge(0.2), volatility_scaled(6.0));
    let mut resampled = request(1, bridge(0.2), volatility_scaled(6.0));
    resampled["design"]["initial_laws"] = json!("resampled");
    let mut half = request(1, bridge(0.2), volatility_scaled(0.5));
    half["problem"]["framework"] = json!("static");
    let several = json!({ "problem": { "assets": ["a", "b"], "rate_per_step": RATE, "centre": smoothed(0.01),
        "history": [[0.01, 0.02], [-0.01, 0.0], [0.02, -0.01]] } });
    let history = [HISTORY, HISTORY].concat();
    let record = json!({ "problem": { "rate_per_step": RATE, "centre": smoothed(0.01), "history": history } });
    for (path, body, field) in [
        ("/train", &known, "problem.centre.kind"),
        ("/train", &parametric, "problem.centre.kind"),
        ("/train", &decaying, "problem.learning.kind"),
        ("/train", &learning, "problem.centre.kind"),
        ("/train", &resampled, "problem.centre.kind"),
        ("/train", &half, "problem.centre.half_life"),
        ("/train", &several, "problem.centre"),
        ("/advise", &several, "problem.centre"),
        ("/frontier", &record, "problem.centre.kind"),
    ] {
        let (status, problem) = app.post(path, body).await;
        assert_eq!((status.as_u16(), problem["field"].as_str()), (422, Some(field)), "{path}: {problem}");
    }
}

/// The bound behind the rule is of returns within the support, and rescaled ones may leave it.
#[test]
fn a_radius_from_the_support_is_refused_for_rescaled_returns() {
    let mut request = request(1, json!({ "rule": "concentration" }), volatility_scaled(6.0));
    request["problem"]["framework"] = json!("static");
    request["problem"]["support"] = json!({ "rule": "between", "min": -1.0, "max": 1.0 });
    let refused = serde_json::from_value::<Specification>(request).unwrap().completed().unwrap_err();
    assert_eq!((refused.field.as_str(), refused.value.as_str()), ("problem.centre", "volatility_scaled"));
}
