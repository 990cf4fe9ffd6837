//! Learning in which newer returns weigh more: `problem.learning`.

use crate::support::App;
use crate::support::policies::{advisor, specification};
use ballast::control::bellman::BellmanStep;
use ballast::control::bellman::next_value::NextValue;
use ballast::control::cache::Cache;
use ballast::control::policy::advice::AdviceSource;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::request::learning::Learning;
use reqwest::StatusCode;
use serde_json::{Value, json};

const HISTORY: [f64; 10] = [0.021, -0.034, 0.052, 0.043, -0.008, 0.017, 0.029, -0.011, 0.036, -0.019];
const HALF_LIFE: f64 = 6.0;

fn bridge() -> Value {
    json!({ "rule": "bridge", "alpha": 0.5, "paths": 200, "scale": 0.2 })
}

fn request(horizon: usize, radius: Value, learning: Value) -> Value {
    json!({ "problem": { "horizon": horizon, "rate_per_step": 0.002, "history": HISTORY, "radius": radius, "learning": learning,
        "utility": { "kind": "power", "risk_aversion": 8.0 } }, "design": { "count": 40 } })
}

fn decay() -> Value {
    json!({ "kind": "decay", "half_life": HALF_LIFE })
}

/// Advice along a path, resolved where `mode` says so.
fn along(solved: &Advisor, mode: AdviceMode) -> Vec<[f64; 3]> {
    let mut state = solved.initial_state(None, None).unwrap();
    let mut advised = Vec::new();
    for (step, log_return) in [0.03, -0.04, 0.01].into_iter().enumerate() {
        let advice = solved.advise(step, &state, mode);
        advised.push([advice.radius, advice.allocation, advice.certainty_equivalent]);
        state = solved.advance(step, &state, &PeriodOutcome::of(0.4, log_return));
    }
    advised
}

/// Weights differ by 1e-14 of themselves, so radii agree to what a search for a quantile leaves, and so does what is solved at the
/// last step. The surrogates before it come from a search for the likeliest scales, which stops where the likelihood is flat to
/// rounding: their predictions agree to a thousandth of what they may err by.
#[test]
fn a_half_life_without_end_is_equal_weights() {
    let equal = advisor(request(3, bridge(), json!({ "kind": "equal" })));
    let endless = advisor(request(3, bridge(), json!({ "kind": "decay", "half_life": 1e15 })));
    for mode in [AdviceMode::Resolve, AdviceMode::Surrogate] {
        let pairs = along(&equal, mode).into_iter().zip(along(&endless, mode));
        for (step, (one, other)) in pairs.enumerate() {
            let apart = [0, 1, 2].map(|index| (one[index] / other[index] - 1.0).abs());
            println!("{mode:?} {step} {one:?} {apart:?}");
            assert!(one[1] > 0.05 && one[1] < 0.95, "{one:?}");
            assert!(apart[0] < 1e-8 && apart[1] < 1e-4 && apart[2] < 1e-7, "{mode:?} {step}: {one:?} {other:?}");
        }
    }
    let decaying = advisor(request(3, bridge(), decay()));
    assert!((along(&decaying, AdviceMode::Resolve)[0][1] - along(&equal, AdviceMode::Resolve)[0][1]).abs() > 0.01);
}

/// The first of two steps, by the policy and with the second solved at every state that follows, by a law that learned the return
/// itself.
#[test]
fn the_value_of_a_decaying_law_is_that_of_steps_in_each_other() {
    for radius in [bridge(), json!({ "rule": "root_n", "kappa": 0.01 })] {
        let body = request(2, radius.clone(), decay());
        let solved = advisor(body.clone());
        let start = solved.initial_state(None, None).unwrap();
        let problem = || solved.policy().problem(Default::default());
        let last = problem();
        let gain = move |state: &State| {
            let step = BellmanStep { problem: &last, step: 1, next: &NextValue::Terminal };
            vec![step.solve(state).floor_gain]
        };
        let first = problem();
        let next = NextValue::Exact(first.holdings(1), Box::new(gain));
        let exact = BellmanStep { problem: &first, step: 0, next: &next }.solve(&start);
        let advice = solved.advise(0, &start, AdviceMode::Surrogate);
        let found = (advice.certainty_equivalent / advice.floor).ln();
        println!("{radius} gain {found:e} {:e} allocation {} {}", exact.floor_gain, advice.allocation, exact.action);
        // Forty points of a surrogate leave a tenth of a basis point.
        assert!((found - exact.floor_gain).abs() < 1e-5, "{radius}: {found} against {}", exact.floor_gain);
        assert!(exact.floor_gain > 1e-4, "{exact:?}");
    }
}

/// `request` with the laws of the design resampled, over a record nine half-lives long.
fn settled(horizon: usize, count: usize) -> Value {
    let record: Vec<f64> = (0..24).map(|k| 0.01 + 0.03 * f64::from(k * 7 % 13 - 6) / 6.0).collect();
    let mut body = request(horizon, bridge(), json!({ "kind": "decay", "half_life": 2.5 }));
    body["problem"]["history"] = json!(record);
    body["problem"]["support"] = json!({ "rule": "none" });
    body["design"] = json!({ "count": count, "initial_laws": "resampled" });
    body
}

#[test]
fn the_first_step_serves_every_law_once_the_record_has_settled() {
    let solved = advisor(settled(3, 60));
    let record = &solved.specification().problem.history;
    let learning = Learning::Decay { half_life: 2.5 };
    // By hand: tanh(n ln(2) / 5) passes 0.99 between 19 and 20.
    assert_eq!(solved.settled_from(), Some(20));
    // Precision that grows for ever.
    assert_eq!(advisor(request(1, bridge(), json!({ "kind": "equal" }))).settled_from(), None);
    let mut state = solved.initial_state(None, None).unwrap();
    let mut read_off = 0;
    for period in 0..40 {
        let advice = solved.advise(0, &state, AdviceMode::Surrogate);
        let resolved = solved.advise(0, &state, AdviceMode::Resolve);
        let gap = (advice.certainty_equivalent / resolved.certainty_equivalent).ln().abs();
        // Two surrogates of sixty points, that of the step and that of the step after: a basis point each.
        assert!(gap < 2e-4, "{period}: {advice:?} {resolved:?}");
        assert!((advice.effective_size / learning.largest_effective_size().unwrap() - 1.0).abs() < 0.01);
        read_off += usize::from(advice.source == AdviceSource::PolicySurrogate);
        let log_return = 0.008 + 0.04 * (f64::from(period) * 2.3).sin();
        // A session that rolls stands at the first step for ever.
        state = State { wealth: 100.0, ..solved.advance(0, &state, &PeriodOutcome::of(advice.allocation, log_return)) };
    }
    assert_eq!(state.law.sample_size(), record.len() + 40);
    assert!(read_off >= 30, "{read_off} of 40 read off the surrogate");
}

async fn trained(horizon: usize) -> App {
    let mut app = App::start().await;
    app.train(&request(horizon, bridge(), decay())).await;
    app.open().await;
    app
}

/// The radius and the moments of a record, by the rules of the policy.
fn measured(record: &[f64]) -> (f64, f64, f64) {
    let resolved = specification(request(1, bridge(), decay())).resolved(&Cache::default());
    let law = resolved.problem.learning.law(record);
    let problem = ballast::control::bellman::problem::Problem::new(&resolved);
    (problem.laws.measure(&law).radius, law.raw_moments(1)[0], law.effective_size())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_learns_by_weight_and_a_correction_keeps_the_order() {
    let app = trained(4).await;
    let supposed = app.post("/what-if", &json!({ "session": app.session, "log_return": 0.05 })).await.1;
    let mut record = HISTORY.to_vec();
    for (period, report) in [json!({ "log_return": 0.05 }), json!({ "missing": true }), json!({ "log_return": -0.02 })]
        .into_iter()
        .enumerate()
    {
        let (status, observed) = app.report(period + 1, report.clone()).await;
        assert_eq!(status, StatusCode::OK, "{observed}");
        record.extend(report["log_return"].as_f64());
        let (radius, mean, effective_size) = measured(&record);
        assert_eq!(observed["radius"], json!(radius));
        assert_eq!((&observed["moments"][0], &observed["effective_size"]), (&json!(mean), &json!(effective_size)));
        if period == 0 {
            let action = app.action().await.1;
            assert_eq!((&supposed["radius"], &supposed["allocation"]), (&action["radius"], &action["allocation"]));
        }
    }
    // The first of the three becomes another return: it keeps its place, two returns old.
    record[HISTORY.len()] = 0.01;
    let correction = json!({ "correction": 1, "period": 1, "log_return": 0.01, "reason": "the index was revised" });
    let (status, corrected) = app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
    assert_eq!(status, StatusCode::OK, "{corrected}");
    assert_eq!(corrected["radius"], json!(measured(&record).0));
    let action = app.action().await.1;
    assert_eq!(action["radius"], json!(measured(&record).0));
    // The record in another order is another law.
    record.reverse();
    assert_ne!(corrected["radius"], json!(measured(&record).0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_policy_is_exported_taken_back_and_asked_as_any_other() {
    let mut app = trained(1).await;
    let exported = app.export().await;
    let document: Value = serde_json::from_slice(&exported).unwrap();
    assert_eq!(document["specification"]["problem"]["learning"], decay());
    let (status, imported) = app.post("/policies/import", &document).await;
    assert!(status.is_success(), "{imported}");
    assert_eq!(imported["policy"], json!(app.policy));
    let problem = request(1, bridge(), decay())["problem"].clone();
    let question = json!({ "problem": problem, "sensitivity": true });
    let (status, advised) = app.post("/advise", &question).await;
    assert_eq!(status, StatusCode::OK, "{advised}");
    let action = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await.1;
    for field in ["allocation", "certainty_equivalent", "radius", "effective_size", "worst_case"] {
        assert_eq!(advised[field], action[field], "{field}");
    }
    // Ten returns of this half-life count as much as fewer, and the caution says so.
    assert!(
        advised["caution"][0]["sentence"].as_str().unwrap().contains("count as much as 9.0 equally weighted ones"),
        "{advised}"
    );
    let present = advised["sensitivity"]["premium"]["present"].as_f64().unwrap();
    let resolved = specification(request(1, bridge(), decay())).resolved(&Cache::default());
    let law = resolved.problem.learning.law(&HISTORY);
    let mean: f64 =
        law.atoms().iter().zip(law.weights()).map(|(z, weight)| weight / law.total_weight() * z.exp_m1()).sum();
    assert!((present - (mean - 0.002)).abs() < 1e-15, "{present}");
    // A restart reads it from the store.
    app.restart().await;
    assert_eq!(app.get(&format!("/action?session={}&explain=worst_case", app.session)).await.1, action);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evaluation_measures_coverage_by_weight() {
    let app = App::start().await;
    let law =
        json!({ "kind": "gaussian_mixture", "components": [{ "weight": 1.0, "mean": 0.008, "variance": 0.001 }] });
    let wide = json!({ "rule": "bridge", "alpha": 0.1, "paths": 500 });
    let mut body = request(1, wide, decay());
    body["problem"]["law"] = law;
    body["problem"]["history"] = json!((0..40).map(|k| 0.008 + 0.001 * f64::from(k)).collect::<Vec<f64>>());
    body["design"] = json!({ "count": 12 });
    (body["frameworks"], body["paths"]) = (json!(["adaptive", "known_law"]), json!(100));
    body["histories"] = json!({ "kind": "drawn", "count": 100 });
    let (status, job) = app.post("/evaluate", &body).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{job}");
    let done = app.until(job["job"].as_str().unwrap(), |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    let report = app.get(done["report"].as_str().unwrap()).await.1;
    let covered = &report["strategies"][0]["coverage"]["by_sample_size"][0]["covered"];
    // The ball of 40 returns that weigh like 17 holds the law in 82 % of cases (an independent simulation of 400, whose standard error is
    // 2 %; the bridge is a limit). Four standard errors of both are 17 %. By equal weights every ball would hold it.
    let share = covered["value"].as_f64().unwrap();
    assert!((share - 0.82).abs() < 0.17, "{covered}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_record_that_no_longer_varies_by_its_weights_is_refused() {
    let app = App::start().await;
    let mut history = vec![0.05, -0.03];
    history.extend([0.01; 60]);
    let mut problem =
        json!({ "rate_per_step": 0.001, "history": history, "learning": { "kind": "decay", "half_life": 1.0 } });
    let (status, refused) = app.post("/advise", &json!({ "problem": problem })).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("problem.history")), "{refused}");
    assert!(refused["rule"].as_str().unwrap().contains("must vary: with the weights of learning"), "{refused}");
    problem["learning"]["half_life"] = json!(12.0);
    assert_eq!(app.post("/advise", &json!({ "problem": problem })).await.0, StatusCode::OK);
}

/// Beyond the horizon of its policy, each period by the policy's first step at the law as it then is, as the library says; through a
/// restart, a correction and a policy put in the place of the first.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_rolls_beyond_its_horizon() {
    let body = settled(2, 20);
    let library = advisor(body.clone());
    let mut app = App::start().await;
    app.train(&body).await;
    app.open_with(json!({ "rolling": true })).await;
    let path = format!("/sessions/{}", app.session);
    let mut state = library.initial_state(None, None).unwrap();
    let (mut earlier, mut supposed): (Vec<State>, Option<Value>) = (Vec::new(), None);
    for period in 1..=8 {
        let advice = library.advise(0, &state, AdviceMode::Surrogate);
        let (status, action) = app.action().await;
        assert_eq!(status, StatusCode::OK, "{action}");
        assert_eq!((&action["period"], &action["radius"]), (&json!(period), &json!(advice.radius)));
        if let Some(supposed) = supposed.take() {
            for field in ["allocation", "certainty_equivalent", "floor", "radius", "source"] {
                assert_eq!(action[field], supposed[field], "{field}: {supposed}");
            }
        }
        assert_eq!(action["allocation"], json!(advice.allocation), "{period}");
        let log_return = 0.012 + 0.03 * (f64::from(period) * 2.3).sin();
        let foretold = app.post("/what-if", &json!({ "session": app.session, "log_return": log_return })).await.1;
        let observed = app.observe(period as usize, log_return).await.1;
        assert_eq!((&foretold["period"], &foretold["radius"]), (&json!(period + 1), &observed["radius"]), "{foretold}");
        supposed = Some(foretold);
        assert_eq!(observed["completed"], json!(false));
        earlier.push(state.clone());
        state = library.advance(0, &state, &PeriodOutcome::of(advice.allocation, log_return));
        assert_eq!(observed["wealth"], json!(state.wealth));
        if period == 4 {
            app.restart().await;
        }
    }
    let summary = app.get(&path).await.1;
    assert_eq!(
        (&summary["state"], &summary["rolling"], &summary["period"]),
        (&json!("active"), &json!(true), &json!(9))
    );
    // The fifth return becomes another: what was held for it, and after it, stays.
    let correction = json!({ "correction": 1, "period": 5, "log_return": 0.05, "reason": "the index was revised" });
    let (status, corrected) = app.post(&format!("{path}/corrections"), &correction).await;
    assert_eq!(status, StatusCode::OK, "{corrected}");
    let history = app.get(&format!("{path}/history")).await.1;
    let held = |period: usize| history["observations"][period]["executed_allocation"].as_f64().unwrap();
    let returned = |period: usize| history["observations"][period]["log_return"].as_f64().unwrap();
    let mut state = earlier.swap_remove(4);
    for period in 4..8 {
        let log_return = if period == 4 { 0.05 } else { returned(period) };
        state = library.advance(0, &state, &PeriodOutcome::of(held(period), log_return));
        let now = &history["observations"][period]["now"];
        assert_eq!((&now["wealth"], &now["radius"]), (&json!(state.wealth), &json!(library.radius(&state))));
    }
    assert_eq!(app.action().await.1["radius"], json!(library.radius(&state)));
    let (status, renewed) = app.post(&format!("{path}/renewals"), &json!({ "renewal": 1, "policy": app.policy })).await;
    assert_eq!(status, StatusCode::OK, "{renewed}");
    app.restart().await;
    assert_eq!(app.action().await.1["radius"], renewed["radius"]);
    assert_eq!(app.observe(9, 0.01).await.0, StatusCode::OK);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_that_cannot_roll_is_refused() {
    let mut app = App::start().await;
    let refused = async |app: &mut App, request: Value, words: &str| {
        let mut opened = request;
        (opened["policy"], opened["rolling"]) = (json!(app.policy), json!(true));
        let (status, refused) = app.post("/sessions", &opened).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("rolling")), "{refused}");
        assert!(refused["rule"].as_str().unwrap().contains(words), "{refused}");
    };
    app.train(&request(2, bridge(), decay())).await;
    refused(&mut app, json!({}), "design.initial_laws is resampled").await;
    app.train(&settled(2, 12)).await;
    refused(&mut app, json!({ "history": HISTORY }), "at least 20 returns with this half-life, but there are 10").await;
    refused(&mut app, json!({ "renew": { "every": 1 } }), "renew").await;
    let long = settled(2, 12)["problem"]["history"].clone();
    let mut short = settled(2, 12);
    short["problem"]["history"] = json!(HISTORY);
    app.train(&short).await;
    refused(&mut app, json!({ "history": long }), "the policy's own history has 10").await;
    for (field, value) in [
        ("contributions", json!(1.0)),
        ("utility", json!({ "kind": "exponential", "risk_aversion": 0.01 })),
        ("framework", json!("static")),
    ] {
        let mut other = settled(2, 12);
        other["problem"][field] = value;
        app.train(&other).await;
        let words = if field == "framework" { "that learns" } else { "does not depend on wealth" };
        refused(&mut app, json!({}), words).await;
    }
    app.train(&settled(2, 12)).await;
    // A rolling session takes no policy that cannot serve it.
    app.open_with(json!({ "rolling": true })).await;
    let (path, settled_policy) = (format!("/sessions/{}/renewals", app.session), app.policy.clone());
    let mut listed = settled(2, 12);
    listed["problem"]["contributions"] = json!([1.0, 2.0]);
    app.train(&listed).await;
    let (status, answer) = app.post(&path, &json!({ "renewal": 1, "policy": app.policy })).await;
    assert_eq!((status.as_u16(), &answer["field"]), (422, &json!("policy")), "{answer}");
    let renewal = json!({ "renewal": 1, "policy": settled_policy, "window": 12 });
    let (status, answer) = app.post(&path, &renewal).await;
    assert_eq!((status.as_u16(), &answer["field"]), (422, &json!("policy")), "{answer}");
}
