//! Advice without a policy or a session is that of a policy for one period, to the last bit.

mod support;

use serde_json::{Value, json};
use support::App;

const HISTORY: [f64; 8] = [0.061, -0.034, 0.052, 0.013, -0.041, 0.083, -0.022, 0.037];

fn problems() -> Vec<Value> {
    let power = || json!({ "kind": "power", "risk_aversion": 12.0 });
    vec![
        json!({ "history": HISTORY, "utility": power(), "radius": { "rule": "bridge", "alpha": 0.5, "paths": 500, "scale": 0.3 } }),
        json!({ "history": HISTORY, "utility": { "kind": "exponential", "risk_aversion": 0.05 },
            "radius": { "rule": "root_n", "kappa": 0.01 }, "trading_cost": 0.004, "contributions": -3.0 }),
        json!({ "history": HISTORY, "framework": "static", "utility": { "kind": "log" }, "action_interval": [0.0, 0.7],
            "radius": { "rule": "fixed", "radius": 0.003 } }),
        json!({ "history": HISTORY, "framework": "parametric_static", "utility": power(),
            "radius": { "rule": "chi_square", "alpha": 0.9 } }),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn it_is_what_a_policy_for_one_period_advises_to_the_last_bit() {
    let mut app = App::start().await;
    let mut held = 0;
    for problem in problems() {
        let (status, advised) =
            app.post("/advise", &json!({ "problem": problem, "wealth": 80.0, "holding": 0.25 })).await;
        assert_eq!(status, 200, "{advised}");
        let mut trained = problem.clone();
        (trained["horizon"], trained["initial_wealth"]) = (json!(1), json!(80.0));
        app.train(&json!({ "problem": trained, "design": { "count": 20 } })).await;
        app.open_with(json!({ "holding": 0.25 })).await;
        let (_, action) = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await;
        let fields =
            ["allocation", "band", "trade", "certainty_equivalent", "floor", "radius", "contribution", "worst_case"];
        for field in fields.into_iter().chain(["holding", "sample_size", "source"]) {
            assert_eq!(advised[field], action[field], "{field} of {problem}");
        }
        held += usize::from(advised["allocation"].as_f64().unwrap() > 0.0);
        assert_eq!(advised["source"], "resolved");
        // The horizon may be said, and nothing else.
        let mut said = problem.clone();
        said["horizon"] = json!(1);
        assert_eq!(app.post("/advise", &json!({ "problem": said, "wealth": 80.0, "holding": 0.25 })).await.1, advised);
    }
    assert!(held >= 3, "{held} of the investors hold anything");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_may_read_may_ask() {
    let mut app = App::start().await;
    let key = app.key("north", "read").await;
    app.restart().await;
    let question = json!({ "problem": { "history": HISTORY } });
    for (held, expected) in [(key.as_str(), 200), ("", 401)] {
        app.hold(held);
        assert_eq!(app.post("/advise", &question).await.0, expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_advised_is_refused_by_field_and_nothing_is_stored() {
    let app = App::start().await;
    let ask = |change: Value, problem: Value| {
        let mut question = json!({ "problem": { "history": HISTORY } });
        question["problem"].as_object_mut().unwrap().extend(problem.as_object().unwrap().clone());
        question.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        question
    };
    for (question, field) in [
        (ask(json!({ "wealth": 0.0 }), json!({})), "wealth"),
        (ask(json!({ "holding": 1.5 }), json!({})), "holding"),
        (ask(json!({ "seed": -1 }), json!({})), "seed"),
        (ask(json!({}), json!({ "horizon": 12 })), "problem.horizon"),
        (ask(json!({}), json!({ "history": [0.1] })), "problem.history"),
        (ask(json!({}), json!({ "rate_per_step": "a tenth" })), "problem.rate_per_step"),
        (ask(json!({ "wealth": 10.0 }), json!({ "contributions": -40.0 })), "problem.initial_wealth"),
        (json!({ "problem": 3 }), "problem"),
        (json!({}), "problem"),
    ] {
        let (status, problem) = app.post("/advise", &question).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{question} {problem}");
    }
    assert_eq!(app.post("/advise", &ask(json!({}), json!({}))).await.0, 200);
    let (_, jobs) = app.get("/jobs").await;
    let (_, policies) = app.get("/policies").await;
    assert_eq!((&jobs["jobs"], &policies["policies"]), (&json!([]), &json!([])));
}
