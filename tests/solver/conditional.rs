//! The conditional centre: `problem.centre` of the kind `conditional`.

use crate::support::App;
use crate::support::policies::{advisor, train};
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::numerics::law::conditional::{effective, kernel_weights, representative};
use ballast::numerics::machine::streams::stream;
use ballast::numerics::statistics::moving_mean::moving_means;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Normal};

fn request(history: &[f64], framework: &str, horizon: usize, radius: &Value, centre: &Value) -> Value {
    json!({ "problem": { "framework": framework, "horizon": horizon, "rate_per_step": 0.002, "history": history,
        "radius": radius, "centre": centre, "risk_aversion": 3.0 }, "design": { "count": 60 } })
}

fn conditional(on: &Value, bandwidth: f64) -> Value {
    json!({ "kind": "conditional", "on": on, "bandwidth": bandwidth })
}

fn bridge() -> Value {
    json!({ "rule": "bridge", "alpha": 0.3, "paths": 400, "scale": 0.3 })
}

/// The allocation, the worth, the radius and the effective size of the advice before the first period.
fn advised(request: Value) -> (f64, f64, f64, f64) {
    let solved: Advisor = advisor(request);
    let (advice, _) = solved.explain(0, &solved.initial_state(None, None).unwrap());
    (advice.allocation, advice.certainty_equivalent, advice.radius, advice.effective_size)
}

fn normals(count: usize, seed: u64) -> Vec<f64> {
    let mut generator = stream(seed, "conditional", 0, 0);
    (0..count).map(|_| generator.sample(StandardNormal)).collect()
}

#[test]
fn weights_agree_with_pencil_and_paper() {
    // Means halved towards each value: 0.02, then 0.03, then 0.01.
    let means = moving_means(&[0.04, -0.01, 0.03], 1.0);
    for (found, expected) in means.iter().zip([0.02, 0.03, 0.01, 0.02]) {
        assert!((found - expected).abs() < 1e-15, "{means:?}");
    }
    // A deviation of 2; the second is 4 from now, the third 2.
    let weights = kernel_weights(&[0.0, 4.0, 2.0, 2.0, 0.0], &[1.0, 1.0, 0.5, 1.0], 2.0_f64.sqrt(), 1.0);
    for (found, expected) in weights.iter().zip([1.0, (-2.0_f64).exp(), 0.5 * (-0.5_f64).exp(), (-0.5_f64).exp()]) {
        assert!((found - expected).abs() < 1e-15, "{weights:?}");
    }
    assert!((effective(&[1.0, 1.0, 0.5]) - 6.25 / 2.25).abs() < 1e-15);
    assert_eq!(representative(&[1.0, 2.0, 3.0], &[1.0; 3], 3), [1.0, 2.0, 3.0]);
    assert_eq!(representative(&[1.0, 2.0, 3.0], &[2.0, 0.0, 2.0], 4), [1.0, 1.0, 3.0, 3.0]);
}

#[test]
fn a_narrow_bandwidth_is_widened_until_enough_returns_count() {
    let known = normals(201, 1);
    let mut known = known.iter().map(|value| value.abs()).collect::<Vec<f64>>();
    known[200] = 9.0;
    for least in [2.0, 30.0, 150.0] {
        let weights = kernel_weights(&known, &[1.0; 200], 0.05, least);
        assert!((effective(&weights) / least - 1.0).abs() < 1e-6, "{least}: {}", effective(&weights));
    }
    assert_eq!(kernel_weights(&known, &[1.0; 200], 0.05, 1e9), [1.0; 200]);
}

#[test]
fn a_bandwidth_without_bound_is_the_empirical_centre_bit_for_bit() {
    let history: Vec<f64> = normals(60, 2).iter().map(|normal| 0.01 + 0.04 * normal).collect();
    let steps = |policy: &Policy| serde_json::to_string(policy.steps()).unwrap();
    let column = json!({ "kind": "column", "values": normals(61, 3) });
    for (framework, horizon) in [("static", 3), ("adaptive", 1)] {
        let trained = |centre: &Value| train(request(&history, framework, horizon, &bridge(), centre));
        let plain = trained(&json!({ "kind": "empirical" }));
        for on in [
            &column,
            &json!({ "kind": "trend", "half_life": 12.0 }),
            &json!({ "kind": "volatility", "half_life": 6.0 }),
        ] {
            assert_eq!(steps(&trained(&conditional(on, 1e15))), steps(&plain), "{framework} {on}");
            let by = |centre: &Value| advised(request(&history, framework, horizon, &bridge(), centre));
            assert_eq!(by(&conditional(on, 1e15)), by(&json!({ "kind": "empirical" })), "{framework} {on}");
            assert_ne!(by(&conditional(on, 0.5)), by(&json!({ "kind": "empirical" })), "{framework} {on}");
        }
    }
}

#[test]
fn a_bandwidth_without_bound_leaves_the_levels_of_caution_of_decaying_returns_as_they_are() {
    let history: Vec<f64> = normals(60, 2).iter().map(|normal| 0.01 + 0.04 * normal).collect();
    let levels = |centre: Value| {
        let mut body = request(&history, "adaptive", 1, &json!({ "rule": "bridge", "paths": 400 }), &centre);
        body["problem"]["learning"] = json!({ "kind": "decay", "half_life": 20.0 });
        body["problem"]["caution"] = json!("balanced");
        serde_json::to_value(advisor(body).specification()).unwrap()["problem"]["levels"].clone()
    };
    let trend = |bandwidth: f64| conditional(&json!({ "kind": "trend", "half_life": 12.0 }), bandwidth);
    assert!(levels(trend(1e15))["balanced"]["scale"].is_f64());
    assert_eq!(levels(trend(1e15)), levels(json!({ "kind": "empirical" })));
    assert_ne!(levels(trend(0.5)), levels(json!({ "kind": "empirical" })));
}

/// A column belongs to the returns of one history, and a path has no figures: what would read them otherwise is refused.
#[tokio::test(flavor = "multi_thread")]
async fn figures_that_would_be_misread_are_refused_by_name() {
    let mut app = App::start().await;
    let history: Vec<f64> = normals(60, 2).iter().map(|normal| 0.01 + 0.04 * normal).collect();
    let column = |values: Vec<f64>| conditional(&json!({ "kind": "column", "values": values }), 1.0);
    let good = request(&history, "static", 2, &bridge(), &column(normals(61, 3)));
    let advise = |change: &dyn Fn(&mut Value)| {
        let mut body = good.clone();
        body.as_object_mut().unwrap().remove("design");
        body["problem"]["horizon"] = json!(1);
        change(&mut body);
        body
    };
    assert_eq!(app.post("/advise", &advise(&|_| ())).await.0, 200);
    let faults: [(Value, &str); 6] = [
        (advise(&|body| body["sensitivity"] = json!(true)), "sensitivity"),
        (advise(&|body| body["problem"]["centre"] = column(normals(60, 3))), "problem.centre.on.values"),
        (advise(&|body| body["problem"]["centre"] = column(vec![1.0; 61])), "problem.centre.on.values"),
        (advise(&|body| body["problem"]["centre"]["on"]["values"][7] = json!(1e16)), "problem.centre.on.values[7]"),
        (advise(&|body| body["problem"]["centre"]["bandwidth"] = json!(0.01)), "problem.centre.bandwidth"),
        (
            advise(&|body| {
                body["problem"]["history"] = json!(history[..30]);
                body["problem"]["centre"] = column(normals(31, 3));
            }),
            "problem.history",
        ),
    ];
    for (body, field) in faults {
        let (status, refused) = app.post("/advise", &body).await;
        assert_eq!((status.as_u16(), refused["field"].as_str()), (422, Some(field)), "{refused}");
    }
    // A present figure that no return resembles is told, and one among the others is not.
    for (now, told) in [(0.1, json!([])), (1e12, json!(["few_alike"]))] {
        let body = advise(&|body| body["problem"]["centre"]["on"]["values"][60] = json!(now));
        let (_, advised) = app.post("/advise", &body).await;
        let codes: Vec<&Value> = advised["warnings"].as_array().unwrap().iter().map(|one| &one["code"]).collect();
        assert_eq!(json!(codes), told, "{advised}");
    }
    let mut evaluation = good.clone();
    evaluation["problem"].as_object_mut().unwrap().remove("framework");
    evaluation["frameworks"] = json!(["static"]);
    let (status, refused) = app.post("/evaluate", &evaluation).await;
    assert_eq!((status.as_u16(), refused["field"].as_str()), (422, Some("problem.centre.kind")), "{refused}");
    app.train(&good).await;
    let session = json!({ "policy": app.policy, "renew": { "every": 1 } });
    let (status, refused) = app.post("/sessions", &session).await;
    assert_eq!((status.as_u16(), refused["field"].as_str()), (422, Some("renew")), "{refused}");
}

/// Returns that follow one of two laws, and a column that says which: a bandwidth that tells them apart solves the problem
/// of the returns of the present law alone.
#[test]
fn two_states_are_two_records() {
    let states: Vec<f64> = (0..121).map(|period| f64::from(u8::from(period * 7 % 11 < 5))).collect();
    let history: Vec<f64> = normals(120, 4)
        .iter()
        .zip(&states)
        .map(|(normal, state)| if *state > 0.5 { 0.02 + 0.03 * normal } else { -0.01 + 0.05 * normal })
        .collect();
    for now in [1.0, 0.0] {
        let mut values = states.clone();
        values[120] = now;
        let alone: Vec<f64> =
            history.iter().zip(&states).filter(|(_, state)| **state == now).map(|(z, _)| *z).collect();
        let centre = conditional(&json!({ "kind": "column", "values": values }), 0.1);
        for (rule, close) in [(json!({ "rule": "fixed", "radius": 0.002 }), 1e-9), (bridge(), 2e-3)] {
            for framework in ["static", "adaptive"] {
                let found = advised(request(&history, framework, 1, &rule, &centre));
                let expected = advised(request(&alone, framework, 1, &rule, &json!({ "kind": "empirical" })));
                assert!((found.3 - alone.len() as f64).abs() < 1e-9, "{found:?}");
                // The bridges of the weighted record have other times.
                assert!((found.2 / expected.2 - 1.0).abs() < close, "{now} {rule} {found:?} {expected:?}");
                assert!((found.0 - expected.0).abs() < close.max(1e-6) * 10.0, "{now} {rule} {found:?} {expected:?}");
                assert!((found.0 > 0.1) == (now == 1.0), "{found:?}");
            }
        }
    }
}

/// Measures what is earned by a covariate that moves the mean, and by the same one shuffled, beyond what is held without it: the mean
/// log certainty equivalent of a period under the true law, over fresh records.
#[test]
fn a_covariate_that_tells_nothing_earns_nothing() {
    const LENGTH: usize = 240;
    const RECORDS: u64 = 60;
    const DEVIATION: f64 = 0.04;
    let rule = json!({ "rule": "fixed", "radius": 0.001 });
    let earned = |shuffled: bool| -> Vec<f64> {
        (0..RECORDS)
            .map(|record| {
                let (known, noise, other) = (
                    normals(LENGTH + 1, 100 + record),
                    normals(LENGTH, 300 + record),
                    normals(LENGTH + 1, 500 + record),
                );
                let mean = |known: f64| 0.006 + 0.012 * known;
                let history: Vec<f64> = known.iter().zip(&noise).map(|(s, e)| mean(*s) + DEVIATION * e).collect();
                // The growth of a share a over the bank, to second order under power utility 3.
                let excess = mean(known[LENGTH]) + 0.5 * DEVIATION * DEVIATION - 0.002;
                let worth = |a: f64| a * excess - 1.5 * a * a * DEVIATION * DEVIATION;
                let values = if shuffled { other } else { known };
                let centre = conditional(&json!({ "kind": "column", "values": values }), 0.5);
                let by = |centre: &Value| worth(advised(request(&history, "adaptive", 1, &rule, centre)).0);
                by(&centre) - by(&json!({ "kind": "empirical" }))
            })
            .collect()
    };
    for (shuffled, pays) in [(false, true), (true, false)] {
        let earned = earned(shuffled);
        let mean = earned.iter().sum::<f64>() / RECORDS as f64;
        let variance = earned.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / (RECORDS - 1) as f64;
        let error = (variance / RECORDS as f64).sqrt();
        println!("shuffled {shuffled}: {mean} +- {error}");
        assert!((mean > 3.0 * error) == pays && (pays || mean < error), "{shuffled}: {mean} +- {error}");
    }
}

/// A covariate that tells nothing leaves the law as it is: the weighted ball holds the law of the returns as often as it says.
#[test]
fn the_weighted_ball_holds_the_law_as_often_as_it_says() {
    const RECORDS: u64 = 150;
    let rule = json!({ "rule": "bridge", "alpha": 0.3, "paths": 400, "scale": 1.0 });
    let law = Normal::new(0.0, 0.04).unwrap();
    let held = (0..RECORDS).filter(|record| {
        let history: Vec<f64> = normals(120, 1000 + record).iter().map(|normal| 0.04 * normal).collect();
        let values = normals(121, 2000 + record);
        let weights = kernel_weights(&values, &[1.0; 120], 0.7, 30.0);
        let total: f64 = weights.iter().sum();
        let radius = advised(request(
            &history,
            "adaptive",
            1,
            &rule,
            &conditional(&json!({ "kind": "column", "values": values }), 0.7),
        ))
        .2;
        let mut weighted: Vec<(f64, f64)> = history.into_iter().zip(weights).collect();
        weighted.sort_by(|one, other| one.0.total_cmp(&other.0));
        // W1 is the area between the distribution functions.
        let (cells, mut place, mut below) = (4000, 0, 0.0);
        let width = 0.4 / f64::from(cells);
        let distance: f64 = (0..cells)
            .map(|cell| {
                let at = -0.2 + (f64::from(cell) + 0.5) * width;
                while place < weighted.len() && weighted[place].0 <= at {
                    below += weighted[place].1 / total;
                    place += 1;
                }
                width * (below - law.cdf(at)).abs()
            })
            .sum();
        distance <= radius
    });
    let share = held.count() as f64 / RECORDS as f64;
    println!("{share}");
    // Three standard errors of the count, and what a record of so few returns misses of its law's spread.
    assert!((0.55..0.85).contains(&share), "{share}");
}
