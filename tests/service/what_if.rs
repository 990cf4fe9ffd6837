//! Hypotheses: equal to what would really be advised, monotone in the radius, and of no consequence.

use crate::support::{App, specification};
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::policy::what_if::{Hypothesis, HypotheticalRadius};
use serde_json::{Value, json};

/// A radius small enough that the robust allocation is not always zero.
fn bold(horizon: usize) -> Value {
    let mut request = specification(horizon);
    request["problem"]["radius"]["scale"] = json!(0.1);
    request
}

async fn session(specification: &Value) -> App {
    let mut app = App::start().await;
    app.train(specification).await;
    app.open().await;
    app
}

async fn what_if(app: &App, mut request: Value) -> Value {
    request["session"] = json!(app.session);
    let (status, answer) = app.post("/what-if", &request).await;
    assert_eq!(status, 200, "{answer}");
    answer
}

/// The fields of an answer to `/action`, taken from an answer of `/what-if`.
#[track_caller]
fn assert_same_action(what_if: &Value, action: &Value) {
    let fields = action.as_object().unwrap().iter().filter(|(field, _)| *field != "caution");
    for (field, value) in fields {
        assert_eq!(&what_if[field], value, "{field}: {what_if} {action}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_supposed_equals_what_is() {
    let app = session(&bold(3)).await;
    let (_, action) = app.action().await;
    assert!(action["allocation"].as_f64().unwrap() > 0.0, "the test shows nothing: {action}");
    assert_same_action(&what_if(&app, json!({})).await, &action);
    assert_same_action(&what_if(&app, json!({ "wealth": 100.0 })).await, &action);
    let (_, resolved) = app.get(&format!("/action?session={}&mode=resolve", app.session)).await;
    assert_same_action(&what_if(&app, json!({ "radius_scale": 1 })).await, &resolved);
    assert_same_action(&what_if(&app, json!({ "radius": action["radius"] })).await, &resolved);
    let (_, explained) = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await;
    let supposed = what_if(&app, json!({ "explain": "worst_case" })).await;
    assert_same_action(&supposed, &explained);
    assert_eq!(supposed["gamma"], explained["worst_case"]["multiplier"]);
    let other = what_if(&app, json!({ "radius_scale": 0.5 })).await;
    assert_eq!((&other["source"], other.get("worst_case")), (&json!("resolved_other_radius"), None), "{other}");
    assert_eq!(other["radius"], json!(0.5 * action["radius"].as_f64().unwrap()));
    let shown = what_if(&app, json!({ "radius_scale": 0.5, "explain": "worst_case" })).await;
    let law = &shown["worst_case"]["transport"];
    let mean: f64 =
        law.as_array().unwrap().iter().map(|m| m["mass"].as_f64().unwrap() * m["moved_to"].as_f64().unwrap()).sum();
    // A sum of eleven products.
    assert!((shown["worst_law"]["mean"].as_f64().unwrap() - mean).abs() < 1e-15, "{shown}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_supposed_return_equals_the_return_observed_in_a_twin_session() {
    let mut app = session(&bold(3)).await;
    let first = app.session.clone();
    for (index, report) in
        [json!({ "log_return": 0.0213 }), json!({ "simple_return": -0.0317 })].into_iter().enumerate()
    {
        let supposed = what_if(&app, report.clone()).await;
        app.open().await;
        let (status, observed) = app.report(1, report).await;
        assert_eq!(status, 200, "{observed}");
        let (_, mut action) = app.action().await;
        action.as_object_mut().unwrap().remove("session");
        assert_same_action(&supposed, &action);
        assert_eq!((&supposed["wealth"], &supposed["period"]), (&observed["wealth"], &json!(2)), "{index}");
        app.session.clone_from(&first);
    }
    let (status, problem) = {
        app.observe(1, 0.01).await;
        app.observe(2, 0.01).await;
        app.post("/what-if", &json!({ "session": app.session, "simple_return": 0.01 })).await
    };
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("simple_return")), "{problem}");
    app.observe(3, 0.01).await;
    assert_eq!(app.post("/what-if", &json!({ "session": app.session })).await.0, 409);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_conservatism_curve_falls_and_never_below_the_floor() {
    let app = session(&bold(3)).await;
    let sweep = json!({ "sweep": { "radius_scale": { "from": 0, "to": 20, "points": 21 } } });
    let answer = what_if(&app, sweep).await;
    let points = answer["points"].as_array().unwrap();
    assert_eq!(points.len(), 21);
    let number = |point: &Value, field: &str| point[field].as_f64().unwrap_or_else(|| panic!("{field} of {point}"));
    for pair in points.windows(2) {
        let [wide, narrow] = [&pair[1], &pair[0]].map(|point| number(point, "certainty_equivalent"));
        // Each is solved on a grid refined for it, to the action's tolerance.
        assert!(wide <= narrow * (1.0 + 1e-9), "{pair:?}");
        assert!(number(&pair[1], "allocation") <= number(&pair[0], "allocation") + 1e-3, "{pair:?}");
    }
    assert!(points.iter().all(|point| number(point, "certainty_equivalent") >= number(point, "floor")));
    assert!(number(&points[0], "allocation") > 0.0 && number(&points[20], "allocation") == 0.0, "{answer}");
    assert_eq!((&points[0]["radius_scale"], &points[20]["radius_scale"]), (&json!(0.0), &json!(20.0)));
    assert_eq!(points[0]["worst_law"]["share_moved"], json!(0.0));
    let one = what_if(&app, json!({ "radius_scale": 2.0 })).await;
    assert_eq!(one["allocation"], points[2]["allocation"]);
    let moved = points.iter().filter(|point| number(&point["worst_law"], "share_moved") > 0.0).count();
    assert!(moved > 0 && points[1]["gamma"].is_f64(), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_touched() {
    let app = session(&bold(3)).await;
    app.observe(1, 0.02).await;
    let facts = async || {
        let history = app.get(&format!("/sessions/{}/history", app.session)).await;
        (history, app.get(&format!("/sessions/{}", app.session)).await, app.action().await)
    };
    let before = facts().await;
    for request in [
        json!({ "wealth": 5.0, "log_return": -0.5, "radius_scale": 3.0 }),
        json!({ "sweep": { "log_return": { "from": -0.2, "to": 0.2, "points": 5 } } }),
        json!({ "sweep": { "wealth": { "from": 50, "to": 200, "points": 4 } }, "explain": "worst_case" }),
    ] {
        what_if(&app, request).await;
    }
    assert_eq!(facts().await, before);
}

#[test]
fn without_a_radius_the_last_step_is_the_plug_in_one() {
    let advisor = |request: &Value| Advisor::new(Policy::from_json(&crate::support::trained(request)).unwrap());
    let adaptive = advisor(&bold(1));
    let mut request = bold(1);
    request["problem"]["framework"] = json!("plug_in");
    let plug_in = advisor(&request);
    let state = adaptive.initial_state(None, None).unwrap();
    let none = Hypothesis { radius: Some(HypotheticalRadius::Scaled(0.0)), ..Hypothesis::default() };
    let supposed = adaptive.suppose(0, None, &state, &none, AdviceMode::Surrogate).unwrap().advice;
    let expected = plug_in.advise(0, &state, AdviceMode::Resolve);
    assert!(expected.allocation > 0.0, "{expected:?}");
    assert_eq!(
        (supposed.allocation, supposed.certainty_equivalent, supposed.radius),
        (expected.allocation, expected.certainty_equivalent, 0.0)
    );
}
