//! Live sessions: equal to the simulator bit for bit, and what they refuse.

use std::time::Duration;

use crate::support::values::number;
use crate::support::{App, specification};
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::control::problem::state::PeriodOutcome;
use serde_json::{Value, json};

const HORIZON: usize = 4;

async fn advisor(app: &App) -> Advisor {
    Advisor::new(Policy::from_json(&app.export().await).unwrap())
}

async fn trained(specification: &Value) -> App {
    let mut app = App::start().await;
    app.train(specification).await;
    app
}

#[track_caller]
fn assert_refused(answer: &(reqwest::StatusCode, Value), status: u16, field: &str, value: impl Into<Value>) {
    let (found, problem) = answer;
    assert_eq!(found.as_u16(), status, "{problem}");
    assert_eq!((&problem["field"], &problem["value"]), (&json!(field), &value.into()), "{problem}");
}

/// Every allocation, wealth and radius of a session as the simulator has them on the returns the service understood.
#[tokio::test(flavor = "multi_thread")]
async fn a_live_session_equals_the_simulator_bit_for_bit() {
    let mut held = 0;
    for (cost, contributions) in
        [(0.0, json!(0.0)), (0.004, json!(0.0)), (0.0, json!(-7.0)), (0.004, json!([5.0, -9.0, 0.0, 2.5]))]
    {
        let mut request = specification(HORIZON);
        // A radius small enough that the robust allocation is not always zero.
        request["problem"]["radius"]["scale"] = json!(0.1);
        request["problem"]["trading_cost"] = json!(cost);
        request["problem"]["contributions"] = contributions;
        held += lived_as_simulated(trained(&request).await).await;
    }
    assert!(held > 9, "the sessions hold nothing");
}

/// Compares every period of two sessions; how many of them hold anything.
async fn lived_as_simulated(mut app: App) -> usize {
    let advisor = advisor(&app).await;
    let own: Vec<f64> = (0..12).map(|k| 0.03 * f64::from(k).sin() + 0.01).collect();
    let mut held = 0;
    let with_own = json!({ "history": own, "wealth": 250.0, "holding": 0.9 });
    for (start, history, wealth, holding) in
        [(json!({}), None, None, 0.0), (with_own, Some(own.as_slice()), Some(250.0), 0.9)]
    {
        app.open_with(start).await;
        let start = advisor.initial_state(history, wealth).unwrap().with_holding(holding).unwrap();
        let reports = [
            json!({ "log_return": 0.0123456789 }),
            json!({ "simple_return": -0.0317 }),
            json!({ "price": 101.3, "previous_price": 99.7 }),
            json!({ "price": 100.1 }),
        ];
        assert_eq!(reports.len(), HORIZON);
        let mut returns = Vec::new();
        for (index, report) in reports.into_iter().enumerate() {
            let (_, action) = app.action().await;
            let (status, observed) = app.report(index + 1, report).await;
            assert_eq!(status, 200, "{observed}");
            returns.push(number(&observed["log_return"]));
            let mut walk = advisor.walk(start.clone(), &returns);
            let advices: Vec<_> = walk.by_ref().collect();
            let state = walk.state;
            let (advice, uncertainty) = (&advices[index], advisor.uncertainty(&state));
            assert_eq!(number(&action["allocation"]), advice.allocation);
            assert_eq!(number(&action["certainty_equivalent"]), advice.certainty_equivalent);
            assert_eq!(number(&action["floor"]), advice.floor);
            assert_eq!((&action["band"], &observed["band"]), (&json!(advice.band), &json!(advice.band)));
            assert_eq!(number(&action["contribution"]), advice.contribution);
            assert_eq!((number(&action["holding"]), number(&action["trade"])), (advice.holding, advice.trade));
            assert_eq!(number(&observed["holding"]), state.holding);
            assert_eq!(number(&action["radius"]), advice.radius);
            assert_eq!(action["source"], json!(advice.source));
            assert_eq!(number(&observed["executed_allocation"]), advice.allocation);
            assert_eq!(number(&observed["wealth"]), state.wealth);
            assert_eq!(number(&observed["radius"]), uncertainty.radius);
            assert_eq!(number(&observed["quantile"]), uncertainty.quantile.unwrap());
            assert_eq!(observed["moments"], json!(uncertainty.moments));
            held += usize::from(advice.allocation > 0.0);
        }
        assert_eq!(returns[1], (-0.0317_f64).ln_1p());
        assert_eq!(returns[2..], [(101.3_f64 / 99.7).ln(), (100.1_f64 / 101.3).ln()]);
    }
    held
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_executed_and_what_was_reached_are_taken_as_stated() {
    let (rate, cost, wealth, allocation, log_return) = (0.002, 0.01, 100.0, 0.37, 0.0213_f64);
    let mut request = specification(3);
    request["problem"]["trading_cost"] = json!(cost);
    let mut app = trained(&request).await;
    app.open().await;
    let (_, first) = app.report(1, json!({ "log_return": log_return, "executed_allocation": allocation })).await;
    let expected =
        wealth * (1.0 - cost * allocation) * ((1.0 - allocation) * (1.0 + rate) + allocation * log_return.exp());
    assert_eq!((number(&first["wealth"]), number(&first["executed_allocation"])), (expected, allocation));
    let (_, second) = app.report(2, json!({ "log_return": 0.01, "wealth": 77.5 })).await;
    assert_eq!(number(&second["wealth"]), 77.5);
    app.restart().await;
    let (_, action) = app.action().await;
    let advisor = advisor(&app).await;
    let mut state = advisor.initial_state(None, None).unwrap();
    state = advisor.advance(0, &state, &PeriodOutcome::of(allocation, log_return));
    state = advisor.advance(1, &state, &PeriodOutcome::of(number(&second["executed_allocation"]), 0.01));
    state.wealth = 77.5;
    let advice = advisor.advise(2, &state, ballast::control::policy::advisor::AdviceMode::Surrogate);
    assert_eq!(number(&action["allocation"]), advice.allocation);
    assert_eq!(number(&action["certainty_equivalent"]), advice.certainty_equivalent);
    let (_, third) = app.report(3, json!({ "log_return": 0.01, "executed_allocation": 1.0 })).await;
    let bought = 1.0 - cost * (1.0 - state.holding);
    assert_eq!(number(&third["wealth"]), 77.5 * bought * (0.0 * (1.0 + rate) + 1.0 * 0.01_f64.exp()));
}

/// A policy that withdraws 40 at the end of each of two periods: 79.84 in the bank pay for them, and nothing less.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_whose_wealth_does_not_last_is_not_opened_and_one_that_comes_to_it_goes_on_in_the_bank() {
    let mut request = specification(3);
    request["problem"]["contributions"] = json!([-40.0, -40.0, 0.0]);
    request["problem"]["trading_cost"] = json!(0.05);
    request["problem"]["initial_wealth"] = json!(85.0);
    let mut app = trained(&request).await;
    for (wealth, holding) in [(79.5, 0.0), (80.5, 0.5)] {
        let start = json!({ "policy": app.policy, "wealth": wealth, "holding": holding });
        let (status, problem) = app.post("/sessions", &start).await;
        assert_eq!((status.as_u16(), &problem["field"], &problem["value"]), (422, &json!("wealth"), &json!(wealth)));
        assert!(problem["detail"].as_str().unwrap().contains("the end of period 2"), "{problem}");
    }
    app.open_with(json!({ "holding": 1.0 })).await;
    app.open_with(json!({ "wealth": 80.0 })).await;
    // Everything held in an asset that falls, whatever was advised: what is left is recorded, and stays in the bank.
    let (status, observed) =
        app.report(1, json!({ "log_return": -0.2, "confirm": true, "executed_allocation": 1.0 })).await;
    assert_eq!(status, 200, "{observed}");
    let left = 80.0 * 0.95 * (-0.2_f64).exp() - 40.0;
    assert!((number(&observed["wealth"]) - left).abs() < 1e-12 && number(&observed["holding"]) == 1.0, "{observed}");
    app.restart().await;
    let (status, action) = app.action().await;
    assert_eq!((status.as_u16(), &action["allocation"], &action["source"]), (200, &json!(0.0), &json!("unsolved")));
    assert!(
        ["certainty_equivalent", "surrogate_sd", "floor"].iter().all(|field| action[field].is_number()),
        "{action}"
    );
    // What no contributions can explain must be told.
    let (status, problem) = app.report(2, json!({ "log_return": -0.2, "confirm": true })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("wealth")), "{problem}");
    let (status, observed) = app.report(2, json!({ "log_return": -0.2, "confirm": true, "wealth": 15.0 })).await;
    assert_eq!((status.as_u16(), number(&observed["wealth"])), (200, 15.0), "{observed}");
    let (_, action) = app.action().await;
    assert!(number(&action["certainty_equivalent"]) >= 15.0, "nothing more is withdrawn: {action}");
    let what_if = json!({ "session": app.session, "sweep": { "wealth": { "from": 1.0, "to": 30.0, "points": 3 } } });
    assert_eq!(app.post("/what-if", &what_if).await.0, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_period_has_one_content_and_the_horizon_is_the_end() {
    let mut app = trained(&specification(2)).await;
    assert_refused(&app.get("/action?session=nobody").await, 404, "session", "nobody");
    app.open().await;
    let report = json!({ "log_return": 0.01, "executed_allocation": 0.5 });
    let first = app.report(1, report.clone()).await;
    assert_eq!(first.0, 200);
    for other in [
        json!({ "log_return": 0.01 }),
        json!({ "log_return": 0.01, "executed_allocation": 0.4 }),
        json!({ "log_return": 0.01, "executed_allocation": 0.5, "wealth": 100.0 }),
        json!({ "simple_return": 0.01, "executed_allocation": 0.5 }),
    ] {
        let answer = app.report(1, other).await;
        assert_refused(&answer, 409, "period", 1);
        assert_eq!(answer.1["type"], "/problems/report-conflict");
    }
    assert_eq!(app.report(1, report).await, first);
    assert_refused(&app.observe(3, 0.01).await, 409, "period", 3);
    assert_eq!(app.observe(2, 0.01).await.1["completed"], true);
    let past = app.observe(3, 0.01).await;
    assert_refused(&past, 409, "period", 3);
    assert_eq!(
        (&past.1["type"], &past.1["rule"]),
        (&json!("/problems/session-completed"), &json!("must be at most 2"))
    );
    assert_refused(&app.action().await, 409, "session", app.session.as_str());
    assert_refused(
        &app.send(reqwest::Method::DELETE, &format!("/policies/{}", app.policy), None).await,
        409,
        "policy",
        app.policy.as_str(),
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_price_needs_the_price_before() {
    let mut app = trained(&specification(4)).await;
    app.open().await;
    assert_refused(&app.report(1, json!({ "price": 101.0 })).await, 422, "previous_price", Value::Null);
    let (_, first) = app.report(1, json!({ "price": 101.0, "previous_price": 100.0 })).await;
    assert_eq!(number(&first["log_return"]), (101.0_f64 / 100.0).ln());
    app.restart().await;
    let (_, second) = app.report(2, json!({ "price": 99.0 })).await;
    assert_eq!(number(&second["log_return"]), (99.0_f64 / 101.0).ln());
    assert_eq!(app.observe(3, 0.01).await.0, 200);
    assert_refused(&app.report(4, json!({ "price": 101.0 })).await, 422, "previous_price", Value::Null);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_static_policy_is_bound_to_its_history() {
    let mut request = specification(2);
    request["problem"]["framework"] = json!("static");
    let mut app = trained(&request).await;
    let foreign = json!({ "policy": app.policy, "history": [0.01, -0.02, 0.03] });
    assert_refused(&app.post("/sessions", &foreign).await, 422, "history", "3 values");
    app.open_with(json!({ "history": request["problem"]["history"], "wealth": 120.0 })).await;
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!((&session["wealth"], &session["sample_size"]), (&json!(120.0), &json!(10)));
    let radius = app.action().await.1["radius"].clone();
    let (_, observed) = app.observe(1, 0.2).await;
    assert_eq!((&observed["radius"], &observed["sample_size"]), (&radius, &json!(11)));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_keeps_its_own_history_and_wealth() {
    let mut app = trained(&specification(2)).await;
    app.open_with(json!({ "history": [0.01, -0.02, 0.03], "wealth": 7.0 })).await;
    app.restart().await;
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!((&session["wealth"], &session["sample_size"], &session["period"]), (&json!(7.0), &json!(3), &json!(1)));
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(history["history"], json!([0.01, -0.02, 0.03]));
    let (_, action) = app.action().await;
    assert_eq!((&action["source"], &action["sample_size"]), (&json!("resolved_outside_design"), &json!(3)));
}

/// Opens a session of the policy under an idempotency key.
async fn open_under(app: &App, key: &str, mut start: Value) -> (reqwest::StatusCode, Value) {
    start["policy"] = json!(app.policy);
    let request = app.client.post(format!("{}/sessions", app.url)).header("Idempotency-Key", key).json(&start);
    crate::support::read(request.send().await.unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn an_opening_repeated_under_its_key_opens_one_session() {
    let mut app = trained(&specification(2)).await;
    let first = open_under(&app, "mine", json!({ "wealth": 50.0 })).await;
    assert_eq!((first.0.as_u16(), &first.1["wealth"]), (201, &json!(50.0)));
    assert_eq!(open_under(&app, "mine", json!({ "wealth": 50.0 })).await, first);
    app.session = first.1["session"].as_str().unwrap().to_owned();
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    app.restart().await;
    assert_eq!(open_under(&app, "mine", json!({ "wealth": 50.0 })).await, first, "the first answer, though it went on");
    let other = open_under(&app, "mine", json!({ "wealth": 51.0 })).await;
    assert_refused(&other, 409, "Idempotency-Key", "mine");
    assert_eq!(other.1["type"], "/problems/idempotency-conflict");
    assert_refused(&open_under(&app, "", json!({})).await, 422, "Idempotency-Key", "0 letters");
    assert_eq!(app.get("/sessions").await.1["sessions"].as_array().unwrap().len(), 1);
    assert_ne!(open_under(&app, "another", json!({ "wealth": 50.0 })).await.1["session"], first.1["session"]);
    assert_eq!(app.delete(&format!("/sessions/{}", app.session)).await, 204);
    let anew = open_under(&app, "mine", json!({ "wealth": 50.0 })).await;
    assert_eq!(anew.0, 201, "the key went with its session");
    assert_ne!(anew.1["session"], first.1["session"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_burst_of_resolves_is_told_to_come_back_and_starves_nobody() {
    let mut app = App::configured(|config| {
        (config.resolve_limit, config.turn_wait) = (0, Duration::from_millis(50));
    })
    .await;
    app.train(&specification(2)).await;
    app.open().await;
    for question in ["mode=resolve", "explain=worst_case"] {
        let request = app.client.get(format!("{}/action?session={}&{question}", app.url, app.session));
        let answer = request.send().await.unwrap();
        assert_eq!((answer.status().as_u16(), answer.headers()["retry-after"].to_str().unwrap()), (503, "1"));
        assert_eq!(crate::support::read(answer).await.1["type"], "/problems/overloaded");
    }
    assert_eq!(app.action().await.0, 200);
    assert_eq!(app.observe(1, 0.01).await.0, 200);
}

/// The share of the record that lies further from its median than `value`, and the share that lies as far or further.
fn as_far(record: &[f64], value: f64) -> [f64; 2] {
    let mut sorted = record.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2]);
    let share = |counts: &dyn Fn(f64) -> bool| {
        sorted.iter().filter(|atom| counts((*atom - median).abs())).count() as f64 / sorted.len() as f64
    };
    [share(&|far| far > (value - median).abs()), share(&|far| far >= (value - median).abs())]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_tells_whether_its_returns_come_as_those_before_did() {
    let mut app = trained(&specification(HORIZON)).await;
    app.open().await;
    let drift = async |app: &App| app.get(&format!("/sessions/{}", app.session)).await.1["drift"].clone();
    assert_eq!(drift(&app).await, json!({ "p_value": null, "capital": 1.0, "highest": 1.0, "level": "none" }));
    let mut record: Vec<f64> = serde_json::from_value(specification(1)["problem"]["history"].clone()).unwrap();
    let mut before = 1.0;
    for (period, log_return) in (1..).zip([0.17, 0.014, -0.16]) {
        assert_eq!(app.observe(period, log_return).await.0, 200);
        record.push(log_return);
        let reported = drift(&app).await;
        let ([further, as_far], capital) = (as_far(&record, log_return), number(&reported["capital"]));
        let p_value = number(&reported["p_value"]);
        assert!(further < p_value && p_value <= as_far, "{further} {reported} {as_far}");
        // A bet on returns that lie far out wins with these and loses with one from the middle.
        assert_eq!(capital > before, log_return.abs() > 0.1, "{reported}");
        assert!(number(&reported["highest"]) >= capital.max(before), "{reported}");
        before = capital;
    }
}
