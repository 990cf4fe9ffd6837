//! Reports of many sessions in one call: each element is what a call of its own would be, over either store.

use crate::support::patience::until;
use crate::support::{App, issue_key, postgres, specification, trained};
use ballast::service::callers::allowance::Limits;
use ballast::service::process::config::StoreLocation;
use ballast::store::KeyRing;
use serde_json::{Value, json};

/// The answers to a list that is answered.
async fn reported(app: &App, list: &Value) -> Vec<Value> {
    let (status, answers) = app.post("/observe", list).await;
    assert_eq!(status, 200, "{answers}");
    answers.as_array().expect("a list").clone()
}

fn statuses(answers: &[Value]) -> Vec<u64> {
    answers.iter().map(|answer| answer["status"].as_u64().expect("a status")).collect()
}

/// Shows the key from now on, once the service knows it.
async fn hold(app: &mut App, key: &str) {
    app.hold(key);
    until("the key to count", async || (app.get("/jobs").await.0 == 200).then_some(())).await;
}

async fn elements_are_as_calls(mut app: App, north: String, south: String) {
    let policy: Value = serde_json::from_slice(&trained(&specification(3))).unwrap();
    app.enter(&south).await;
    app.policy = app.post("/policies/import", &policy).await.1["policy"].as_str().unwrap().to_owned();
    app.open().await;
    let foreign = app.session.clone();
    hold(&mut app, &north).await;
    assert_eq!(app.post("/policies/import", &policy).await.0, 201);
    let mut sessions = Vec::new();
    for _ in 0..5 {
        app.open().await;
        sessions.push(app.session.clone());
    }
    let report = |session: &str, period: usize, log_return: f64| json!({ "session": session, "period": period, "log_return": log_return });
    let alone = report(&sessions[1], 1, 0.02);
    let (status, answer) = app.post("/observe", &alone).await;
    assert_eq!(status, 200, "{answer}");
    let list = json!([
        report(&sessions[0], 1, 0.01),
        alone,
        report("session_of_nobody", 1, 0.01),
        report(&sessions[2], 2, 0.01),
        report(&foreign, 1, 0.01),
        report(&sessions[3], 1, 1.5),
        report(&sessions[4], 1, 7.0),
    ]);
    let answers = reported(&app, &list).await;
    assert_eq!(statuses(&answers), [200, 200, 404, 409, 404, 409, 422], "{answers:?}");
    assert_eq!(answers[1]["answer"], answer);
    assert_eq!(reported(&app, &list).await, answers, "the same list again");
    for (answer, report) in answers.iter().zip(list.as_array().unwrap()) {
        assert_eq!([&answer["session"], &answer["period"]], [&report["session"], &report["period"]]);
        let (status, single) = app.post("/observe", report).await;
        let as_a_call = if status == 200 { &answer["answer"] } else { &answer["problem"] };
        assert_eq!((answer["status"].as_u64(), as_a_call), (Some(status.as_u16().into()), &single));
        assert_eq!(answer.as_object().unwrap().len(), 4, "{answer}");
    }
    let kind = |index: usize| answers[index]["problem"]["type"].as_str().unwrap();
    assert_eq!([3, 5, 6].map(kind), ["/problems/report-gap", "/problems/unconfirmed", "/problems/invalid-field"]);

    // Refused as a whole, and nothing of it is recorded.
    let twice = json!([report(&sessions[2], 1, 0.01), report(&sessions[3], 1, 0.0), report(&sessions[2], 2, 0.01)]);
    let (status, problem) = app.post("/observe", &twice).await;
    assert_eq!(
        (status.as_u16(), &problem["field"], &problem["value"]),
        (422, &json!("[2].session"), &json!(sessions[2]))
    );
    let (status, problem) = app.post("/observe", &json!([])).await;
    assert_eq!(
        (status.as_u16(), &problem["field"], &problem["rule"]),
        (422, &json!("body"), &json!("must hold 1 to 1000 reports"))
    );
    assert_eq!(app.get(&format!("/sessions/{}", sessions[2])).await.1["period"], 1);
    assert_eq!(app.get(&format!("/sessions/{}", sessions[0])).await.1["period"], 2);
    let deeds = app.get(&format!("/sessions/{}/history", sessions[0])).await.1;
    assert_eq!(deeds["observations"][0]["wealth"], answers[0]["answer"]["wealth"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn each_element_is_answered_as_a_call_of_its_own_over_a_folder() {
    let app = App::start().await;
    let keys = [app.key("north", "operate,train,read").await, app.key("south", "operate,train,read").await];
    let [north, south] = keys;
    elements_are_as_calls(app, north, south).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_element_is_answered_as_a_call_of_its_own_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    let location = StoreLocation::Postgres(url.parse().unwrap());
    let app = App::configured(|config| config.store = location).await;
    let key = async |tenant| {
        let ring = KeyRing::connect(&url.parse().unwrap()).await.unwrap();
        issue_key(&ring, tenant, "operate,train,read").await
    };
    let (north, south) = (key("north").await, key("south").await);
    elements_are_as_calls(app, north, south).await;
}

/// A thousand reports with every field that a report has, of sessions that nobody has.
fn thousand() -> Value {
    let session = |index: u32| format!("session_{index:032}");
    let report = |index| {
        json!({ "session": session(index), "period": 1, "price": 101.23456789012345, "previous_price": 100.12345678901234,
            "date": "2008-09-30", "rate": 0.0012345678901234567, "flow": -12.345678901234567,
            "executed_allocation": 0.12345678901234567, "wealth": 12345.678901234567, "confirm": true })
    };
    (0..1000).map(report).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_thousand_reports_are_taken_and_one_more_is_not() {
    let app = App::start().await;
    let mut list = thousand();
    let answers = reported(&app, &list).await;
    assert_eq!((answers.len(), statuses(&answers).iter().all(|status| *status == 404)), (1000, true));
    list.as_array_mut().unwrap().push(json!({ "session": "one more", "period": 1, "log_return": 0.0 }));
    let (status, problem) = app.post("/observe", &list).await;
    assert_eq!((status.as_u16(), &problem["rule"]), (422, &json!("must hold 1 to 1000 reports")));
}

#[tokio::test(flavor = "multi_thread")]
async fn limits_count_elements_and_not_calls() {
    const RATE: u32 = 10;
    let app = App::configured(|config| config.limits = Limits::new([RATE, 0, 0], 64)).await;
    let answers = reported(&app, &thousand()).await;
    let found = statuses(&answers);
    let (passed, put_off) = found.iter().partition::<Vec<u64>, _>(|status| **status == 404);
    // As many as may come at once, and what time adds to them.
    assert!((RATE as usize..5 * RATE as usize).contains(&passed.len()), "{} of {} passed", passed.len(), found.len());
    assert!(put_off.iter().all(|status| *status == 429) && found[0] == 404, "{found:?}");
    let problem = &answers.last().unwrap()["problem"];
    assert_eq!((&problem["type"], &problem["value"]), (&json!("/problems/too-many-requests"), &json!("live")));
}

/// Sessions far outside the design, whose every report is solved.
async fn far(app: &mut App, sessions: usize) -> Value {
    app.train(&specification(2)).await;
    let mut list = Vec::new();
    for _ in 0..sessions {
        app.open_with(json!({ "history": [0.3, -0.25, 0.2, -0.3, 0.25], "wealth": 900.0 })).await;
        list.push(json!({ "session": app.session, "period": 1, "log_return": 0.01 }));
    }
    list.into()
}

#[tokio::test(flavor = "multi_thread")]
async fn elements_that_solve_wait_for_each_other_and_count_as_heavy() {
    const SESSIONS: usize = 6;
    // One place for the tenant: more at a time would be refused.
    let mut app = App::configured(|config| config.limits = Limits::new([0; 3], 1)).await;
    let list = far(&mut app, SESSIONS).await;
    assert_eq!(statuses(&reported(&app, &list).await), [200; SESSIONS]);
    let mut app = App::configured(|config| config.limits = Limits::new([0, 2, 0], 64)).await;
    let list = far(&mut app, SESSIONS).await;
    let answers = reported(&app, &list).await;
    let put_off: Vec<&Value> = answers.iter().filter(|answer| answer["status"] == 429).collect();
    assert!((1..SESSIONS).contains(&put_off.len()), "{answers:?}");
    assert!(put_off.iter().all(|answer| answer["problem"]["value"] == "heavy"), "{answers:?}");
    // What was put off is recorded in its turn, and the rest is told again.
    until("their turn", async || {
        let again = reported(&app, &list).await;
        statuses(&again).iter().all(|status| *status == 200).then_some(())
    })
    .await;
}
