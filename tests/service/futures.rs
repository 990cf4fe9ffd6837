//! The futures of a policy and of a session over HTTP.

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::support::{App, specification};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

async fn futures(app: &App, path: &str) -> Value {
    let (status, futures) = app.get(path).await;
    assert_eq!(status, StatusCode::OK, "{futures}");
    futures
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_plays_on_from_where_it_is() {
    let mut app = App::start().await;
    let mut request = specification(3);
    request["problem"]["radius"]["scale"] = json!(0.2);
    app.train(&request).await;
    let of_policy = format!("/policies/{}/futures?paths=40", app.policy);
    let first = futures(&app, &of_policy).await;
    app.open().await;
    let of_session = format!("/sessions/{}/futures?paths=40", app.session);
    // A session at its start is its policy.
    assert_eq!(futures(&app, &of_session).await, first);
    let [worst, record] = ["worst", "record"].map(|world| first["courses"][0][world].as_array().unwrap().clone());
    assert_eq!((worst.len(), record.len(), &first["period"], &first["paths"]), (4, 4, &json!(1), &json!(40)));
    let start = 100.0;
    assert_eq!((number(&worst[0]["low"]), number(&worst[0]["high"])), (start, start));
    assert!(number(&worst[3]["median"]) <= number(&record[3]["median"]), "{first}");
    // What it says is what the answer to a question about its action says.
    let action = app.action().await.1;
    assert_eq!(number(&first["promised"]), number(&action["certainty_equivalent"]));

    let report = json!({ "session": app.session, "period": 1, "log_return": -0.02 });
    assert_eq!(app.post("/observe", &report).await.0, StatusCode::OK);
    let second = futures(&app, &of_session).await;
    let course = second["courses"][0]["worst"].as_array().unwrap();
    let wealth = app.get(&format!("/sessions/{}", app.session)).await.1["wealth"].clone();
    assert_eq!((&second["period"], course.len()), (&json!(2), 3));
    assert_eq!(number(&course[0]["median"]), number(&wealth));
    for period in [2, 3] {
        let report = json!({ "session": app.session, "period": period, "log_return": 0.01 });
        assert_eq!(app.post("/observe", &report).await.0, StatusCode::OK);
    }
    assert_eq!(app.get(&of_session).await.0, StatusCode::CONFLICT);
    for (paths, status) in [("19", 422), ("1001", 422), ("many", 400)] {
        let (found, problem) = app.get(&format!("/policies/{}/futures?paths={paths}", app.policy)).await;
        assert_eq!((found.as_u16(), &problem["field"]), (status, &json!("paths")), "{problem}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_declared_problem_has_a_course_of_each_state_and_of_what_is_earned() {
    let mut app = App::start().await;
    let mut request = crate::decide::stock(3);
    request["design"]["count"] = json!(60);
    app.train(&request).await;
    let found = futures(&app, &format!("/policies/{}/futures?paths=20", app.policy)).await;
    let names: Vec<&str> =
        found["courses"].as_array().unwrap().iter().map(|course| course["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["stock", "earned"]);
    let decided = app.post("/decide", &json!({ "policy": app.policy })).await.1;
    assert_eq!(number(&found["promised"]), number(&decided["value"]));
    assert_eq!(found["stated_error"], Value::Null);
}
