//! The surface of a policy: each of its cells is what a session with that record is advised.

use crate::support::{App, specification};
use serde_json::{Value, json};

/// The two allocations are computed from records that differ by rounding, and smoothed by a Gaussian process.
const ROUNDING: f64 = 1e-7;
/// Rate of the bank in a period.
const RATE: f64 = 0.002;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// A policy for any record; under power utility wealth does not matter.
fn any_record(utility: Value) -> Value {
    let mut request = specification(4);
    request["problem"]["utility"] = utility;
    request["problem"]["radius"]["scale"] = json!(0.1);
    request["design"] = json!({ "count": 40, "initial_laws": "resampled" });
    request
}

/// The record of `request`, continued with its own returns, in standard deviations from its mean.
fn shape(request: &Value, step: usize) -> Vec<f64> {
    let history = numbers(&request["problem"]["history"]);
    let all: Vec<f64> = history.iter().copied().cycle().take(history.len() + step).collect();
    let average = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mean = average(&all);
    let deviation = average(&all.iter().map(|value| (value - mean).powi(2)).collect::<Vec<_>>()).sqrt();
    all.iter().map(|value| (value - mean) / deviation).collect()
}

/// The advice after `step` periods in the bank to a session whose record has this shape, mean and deviation.
async fn advised(app: &mut App, shape: &[f64], step: usize, (wealth, mean, deviation): (f64, f64, f64)) -> Value {
    let record: Vec<f64> = shape.iter().map(|value| mean + deviation * value).collect();
    let (history, reported) = record.split_at(record.len() - step);
    let before = wealth / (1.0 + RATE).powi(step as i32);
    app.open_with(json!({ "history": history, "wealth": before })).await;
    for (period, log_return) in reported.iter().enumerate() {
        let report = json!({ "session": app.session, "period": period + 1, "log_return": log_return, "confirm": true,
            "executed_allocation": 0.0 });
        assert_eq!(app.post("/observe", &report).await.0, 200);
    }
    app.action().await.1
}

async fn surface(app: &App, query: &str) -> Value {
    let (status, surface) = app.get(&format!("/policies/{}/surface?{query}", app.policy)).await;
    assert_eq!(status, 200, "{surface}");
    surface
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cell_is_what_a_session_with_that_record_is_advised() {
    for (utility, step, across) in [
        (json!({ "kind": "power", "risk_aversion": 3.0 }), 2, "deviation"),
        (json!({ "kind": "exponential", "risk_aversion": 0.01 }), 1, "wealth"),
        (json!({ "kind": "exponential", "risk_aversion": 0.01 }), 0, "deviation"),
    ] {
        let (mut app, request) = (App::start().await, any_record(utility));
        app.train(&request).await;
        let (drawn, shape) = (surface(&app, &format!("step={step}&across={across}")).await, shape(&request, step));
        assert_eq!((&drawn["step"], &drawn["across"]), (&json!(step), &json!(across)), "{drawn}");
        let (columns, means) = (numbers(&drawn["columns"]), numbers(&drawn["means"]));
        let [wealth, deviation] = ["wealth", "deviation"].map(|of| drawn["middle"][of].as_f64().unwrap());
        let mut solved = 0;
        for (row, column) in [(15, 10), (18, 12), (12, 4), (20, 8), (0, 0), (30, 20), (30, 0)] {
            let place = match across {
                "wealth" => (columns[column], means[row], deviation),
                _ => (wealth, means[row], columns[column]),
            };
            let advice = advised(&mut app, &shape, step, place).await;
            let [cell, in_design] = ["allocations", "in_design"].map(|of| &drawn[of][row][column]);
            assert_eq!(in_design, &advice["in_design"], "{across} at {row}, {column}: {advice}");
            if in_design == true {
                let [drawn, advised] = [cell, &advice["allocation"]].map(|value| value.as_f64().unwrap());
                assert!((drawn - advised).abs() < ROUNDING, "{across} at {row}, {column}: {drawn} {advised}");
                solved += usize::from(drawn > 0.0);
            }
        }
        assert!(solved >= 2, "{across}: nothing is held but in {solved} cells");
        assert!(drawn["design"].as_array().unwrap().len() == 40, "{}", drawn["design"]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn money_still_to_come_is_no_wealth() {
    let (mut app, mut request) =
        (App::start().await, any_record(json!({ "kind": "exponential", "risk_aversion": 0.01 })));
    request["problem"]["contributions"] = json!(60.0);
    request["design"]["wealth"] = json!({ "min": 20.0, "max": 400.0 });
    app.train(&request).await;
    let (drawn, shape) = (surface(&app, "across=wealth").await, shape(&request, 0));
    let (columns, means) = (numbers(&drawn["columns"]), numbers(&drawn["means"]));
    let grain = columns[1] - columns[0];
    assert!(grain > 0.0 && columns[0] >= 1.0, "{columns:?}");
    assert!(columns.windows(2).all(|pair| (pair[1] - pair[0] - grain).abs() < 1e-9), "{columns:?}");
    let deviation = drawn["middle"]["deviation"].as_f64().unwrap();
    for (row, column) in [(15, 1), (15, 10), (20, 15)] {
        let advice = advised(&mut app, &shape, 0, (columns[column], means[row], deviation)).await;
        assert_eq!(drawn["in_design"][row][column], advice["in_design"], "{advice}");
        let [drawn, advised] =
            [&drawn["allocations"][row][column], &advice["allocation"]].map(|value| value.as_f64().unwrap());
        assert!(advice["in_design"] == false || (drawn - advised).abs() < ROUNDING, "{drawn} {advised}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn one_state_is_one_cell_and_the_policys_own_record_is_advised_as_a_session_is() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    let (advice, single) = (app.action().await.1, surface(&app, "").await);
    assert_eq!((&single["axes"], single["allocations"].as_array().unwrap().len()), (&json!([]), 1), "{single}");
    for field in ["allocation", "band", "certainty_equivalent", "radius", "source"] {
        assert_eq!(single["advice"][field], advice[field], "{field}");
    }
    // After one return of that size the session is advised what its row says.
    let learned = surface(&app, "step=1&across=deviation").await;
    assert_eq!((&learned["axes"], &learned["across"]), (&json!(["wealth"]), &json!("wealth")), "{learned}");
    let wealth = numbers(&learned["columns"]);
    let mut compared = 0;
    for (row, log_return) in numbers(&learned["observed_means"]).into_iter().enumerate() {
        app.open_with(json!({ "wealth": wealth[10] / (1.0 + RATE) })).await;
        let report = json!({ "session": app.session, "period": 1, "log_return": log_return, "confirm": true,
            "executed_allocation": 0.0 });
        assert_eq!(app.post("/observe", &report).await.0, 200);
        let advice = app.action().await.1;
        assert_eq!(learned["in_design"][row][10], advice["in_design"], "{row}: {advice}");
        if advice["in_design"] == true {
            let [drawn, advised] =
                [&learned["allocations"][row][10], &advice["allocation"]].map(|value| value.as_f64().unwrap());
            assert!((drawn - advised).abs() < ROUNDING, "{row}: {drawn} {advised}");
            compared += 1;
        }
    }
    assert!(compared > 15, "{compared} of 31 rows lie in the design");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_or_a_direction_that_there_is_not_is_refused_by_name() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    let policy = app.policy.clone();
    for (path, status, named) in [
        (format!("/policies/{policy}/surface?step=2"), 422, "step"),
        (format!("/policies/{policy}/surface?step=-1"), 400, "step"),
        (format!("/policies/{policy}/surface?across=mean"), 400, "across"),
        (format!("/policies/{policy}/surface?row=1"), 400, "row"),
        (format!("/policies/{}/surface", "0".repeat(64)), 404, "policy"),
    ] {
        let (found, problem) = app.get(&path).await;
        assert_eq!((found.as_u16(), &problem["field"]), (status, &json!(named)), "{path}: {problem}");
    }
}
