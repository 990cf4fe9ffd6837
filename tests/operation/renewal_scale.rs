//! Many sessions of one strategy renew by one training. A training that no session requests any more is cancelled. A
//! session whose next policy is late continues.

use std::time::{Duration, Instant};

use crate::support::patience::until;
use crate::support::{App, postgres, specification};
use ballast::service::process::config::StoreLocation;
use ballast::store::Quotas;
use futures_util::StreamExt;
use futures_util::stream;
use reqwest::StatusCode;
use serde_json::{Value, json};

/// Returns a training with power utility, under which no design depends on wealth.
fn request(horizon: usize) -> Value {
    let mut request = specification(horizon);
    request["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 3.0 });
    request
}

/// Keeps the trainer busy until it is cancelled.
async fn busy(app: &App) -> String {
    let mut long = request(12);
    long["design"]["count"] = json!(1500);
    let job = app.queue(&long).await;
    app.until(&job, |job| job["state"] == "running").await;
    job
}

async fn session(app: &App, session: &str) -> Value {
    app.get(&format!("/sessions/{session}")).await.1
}

async fn jobs(app: &App) -> Vec<Value> {
    app.get("/jobs?limit=1000").await.1["jobs"].as_array().unwrap().clone()
}

async fn open(app: &App, count: usize, renew: Value) -> Vec<String> {
    let body = &json!({ "policy": app.policy, "renew": renew });
    let opened = stream::iter(0..count).map(|_| async move {
        let (status, session) = app.post("/sessions", body).await;
        assert_eq!(status, 201, "{session}");
        session["session"].as_str().unwrap().to_owned()
    });
    opened.buffer_unordered(8).collect().await
}

async fn observe(app: &App, session: &str, period: usize, log_return: f64) -> (StatusCode, Value) {
    app.post("/observe", &json!({ "session": session, "period": period, "log_return": log_return })).await
}

async fn job_of(app: &App, name: &str) -> String {
    let job = async || session(app, name).await["renewal"]["job"].as_str().map(str::to_owned);
    until("the job of the renewal", job).await
}

/// Renews `count` sessions of one strategy, and returns the time that it took.
async fn by_one_training(mut app: App, count: usize) -> Duration {
    app.train(&request(3)).await;
    let (sessions, before) = (open(&app, count, json!({ "every": 1 })).await, jobs(&app).await.len());
    let started = Instant::now();
    let reported = stream::iter(&sessions).map(|session| observe(&app, session, 1, 0.012));
    reported
        .buffer_unordered(8)
        .for_each(|(status, observed)| async move { assert_eq!(status, 200, "{observed}") })
        .await;
    let mut policies = Vec::new();
    for name in &sessions {
        let renewed = async || {
            let now = session(&app, name).await;
            (now["renewals"] == 1).then(|| now["policy"].as_str().unwrap().to_owned())
        };
        let mut policy = None;
        for _ in 0..3000 {
            policy = renewed().await;
            if policy.is_some() {
                break;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        policies.push(policy.expect("a session was not renewed"));
    }
    let took = started.elapsed();
    policies.dedup();
    assert_eq!(policies.len(), 1);
    assert_eq!(jobs(&app).await.len(), before + 1, "one training for all");
    // Another session that reaches the same record finds the policy there.
    let late = open(&app, 1, json!({ "every": 1 })).await;
    assert_eq!(observe(&app, &late[0], 1, 0.012).await.0, 200);
    let renewed = async || (session(&app, &late[0]).await["renewals"] == 1).then_some(());
    until("a session whose next policy is there", renewed).await;
    assert_eq!(jobs(&app).await.len(), before + 1);
    took
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_of_one_strategy_renew_by_one_training_over_a_folder() {
    by_one_training(App::start().await, 40).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_of_one_strategy_renew_by_one_training_over_a_database() {
    let Some(app) = App::over_a_database().await else { return };
    by_one_training(app, 40).await;
}

/// Measures the figure of `docs/capacity.md`.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "a measurement"]
async fn a_thousand_sessions_renew() {
    println!("1,000 sessions renewed in {:.1} s", by_one_training(App::start().await, 1000).await.as_secs_f64());
    let Some(app) = App::over_a_database().await else { return };
    println!("1,000 over PostgreSQL in {:.1} s", by_one_training(app, 1000).await.as_secs_f64());
}

async fn a_deleted_session_takes_its_training_with_it(mut app: App) {
    app.train(&request(3)).await;
    let sessions = open(&app, 3, json!({ "every": 1 })).await;
    let busy = busy(&app).await;
    // Two sessions share a training, and the third has one of its own.
    for (session, log_return) in sessions.iter().zip([0.01, 0.01, 0.02]) {
        assert_eq!(observe(&app, session, 1, log_return).await.0, 200);
    }
    let [first, second, third] = [&sessions[0], &sessions[1], &sessions[2]];
    let (shared, own) = (job_of(&app, first).await, job_of(&app, third).await);
    assert_eq!(job_of(&app, second).await, shared);
    assert_ne!(own, shared);
    let state = async |job: &str| app.get(&format!("/jobs/{job}")).await.1["state"].as_str().unwrap().to_owned();
    assert_eq!(app.delete(&format!("/sessions/{first}")).await, 204);
    assert_eq!(app.delete(&format!("/sessions/{third}")).await, 204);
    until("the training of a deleted session", async || (state(&own).await == "cancelled").then_some(())).await;
    assert_eq!(state(&shared).await, "queued", "the other session needs it");
    // After a manual renewal the session no longer needs the training.
    let renewal = json!({ "renewal": 1, "policy": app.policy });
    assert_eq!(app.post(&format!("/sessions/{second}/renewals"), &renewal).await.0, 200);
    until("a training that nobody needs", async || (state(&shared).await == "cancelled").then_some(())).await;
    let (status, conflict) = app
        .post(&format!("/sessions/{second}/renewals"), &json!({ "renewal": 1, "policy": app.policy, "window": 5 }))
        .await;
    assert_eq!(
        (status, conflict["rule"].as_str()),
        (StatusCode::CONFLICT, Some("must be 2 for another renewal, because renewal 1 exists")),
        "{conflict}"
    );
    assert!(conflict["detail"].as_str().unwrap().contains("read the session again"), "{conflict}");
    app.cancel(&busy).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_no_session_requests_is_not_trained_over_a_folder() {
    a_deleted_session_takes_its_training_with_it(App::start().await).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_no_session_requests_is_not_trained_over_a_database() {
    let Some(app) = App::over_a_database().await else { return };
    a_deleted_session_takes_its_training_with_it(app).await;
}

/// The next policies of these sessions all differ: few of their trainings wait at a time, and callers can use their
/// whole quota.
async fn trainings_of_sessions_are_in_no_callers_way(mut app: App) {
    app.train(&request(2)).await;
    let sessions = open(&app, 14, json!({ "every": 1 })).await;
    let busy = busy(&app).await;
    for (index, session) in sessions.iter().enumerate() {
        assert_eq!(observe(&app, session, 1, 0.001 * index as f64).await.0, 200);
    }
    let queued = async || jobs(&app).await.iter().filter(|job| job["state"] == "queued").count();
    until("trainings in the queue", async || (queued().await == 8).then_some(())).await;
    // As many as the quota allows, and no more.
    let mut own = Vec::new();
    for _ in 0..3 {
        own.push(app.queue(&request(3)).await);
    }
    assert_eq!(app.post("/train", &request(3)).await.0, 429);
    for job in own.iter().chain([&busy]) {
        app.cancel(job).await;
    }
    for name in &sessions {
        let renewed = async || (session(&app, name).await["renewals"] == 1).then_some(());
        until("a session in line", renewed).await;
    }
    assert!(queued().await == 0);
}

fn quotas() -> Quotas {
    Quotas { queued_jobs: 3, ..Quotas::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn trainings_of_sessions_are_bounded_apart_over_a_folder() {
    trainings_of_sessions_are_in_no_callers_way(App::configured(|config| config.quotas = quotas()).await).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn trainings_of_sessions_are_bounded_apart_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    let store = StoreLocation::Postgres(url.parse().unwrap());
    let app = App::configured(|config| (config.quotas, config.store) = (quotas(), store)).await;
    trainings_of_sessions_are_in_no_callers_way(app).await;
}

/// A session reports three periods in quick succession under a policy of three periods.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_whose_next_policy_is_late_waits_and_goes_on_by_the_last_step() {
    let mut app = App::start().await;
    let returns = [0.012, -0.031, 0.027, 0.004, -0.016];
    app.train(&request(3)).await;
    let policy = app.policy.clone();
    app.open_with(json!({ "name": "late", "renew": { "every": 2 } })).await;
    let busy = busy(&app).await;
    for period in 1..=3 {
        let (status, observed) = observe(&app, &app.session, period, returns[period - 1]).await;
        assert_eq!((status, &observed["completed"]), (StatusCode::OK, &json!(false)), "{observed}");
    }
    let now = session(&app, &app.session).await;
    assert_eq!(json!([now["state"], now["period"], now["horizon"]]), json!(["waiting", 4, 3]));
    let listed = app.get("/sessions?search=late&count=care").await.1;
    let row = &listed["sessions"][0];
    assert_eq!(json!([row["state"], row["care"]]), json!(["waiting", ["renewal"]]));
    assert_eq!(json!([listed["care"]["sessions"], listed["care"]["renewal"]]), json!([1, 1]));
    for (state, total) in [("waiting", 1), ("care", 1), ("renewal", 1), ("active", 0), ("completed", 0)] {
        assert_eq!(app.get(&format!("/sessions?count=total&state={state}")).await.1["total"], total, "{state}");
    }

    // The advice is that of the policy's last step, under the law of all returns reported. A session in its last period
    // with the same record gets the same advice.
    for period in 4..=5 {
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        let cautions: Vec<&Value> =
            action["caution"].as_array().unwrap().iter().filter(|caution| caution["code"] == "waiting").collect();
        assert_eq!(cautions.len(), 1, "{action}");
        let sentence = cautions[0]["sentence"].as_str().unwrap();
        assert!(sentence.contains("ended with period 3") && sentence.contains("last step"), "{sentence}");
        let history: Vec<f64> = request(3)["problem"]["history"]
            .as_array()
            .unwrap()
            .iter()
            .map(|value| value.as_f64().unwrap())
            .chain(returns[..period - 3].iter().copied())
            .collect();
        let body =
            json!({ "policy": policy, "history": history, "wealth": session(&app, &app.session).await["wealth"] });
        let (_, twin) = app.post("/sessions", &body).await;
        let twin = twin["session"].as_str().unwrap().to_owned();
        for (number, log_return) in (1..).zip(&returns[period - 3..period - 1]) {
            assert_eq!(observe(&app, &twin, number, *log_return).await.0, 200);
        }
        let same = app.get(&format!("/action?session={twin}")).await.1;
        for field in ["allocation", "radius", "sample_size"] {
            let [advised, same] = [&action, &same].map(|answer| answer[field].as_f64().unwrap());
            assert!((advised - same).abs() < 1e-9, "period {period}, {field}: {advised} and {same}");
        }
        let before = action;
        app.restart().await;
        assert_eq!(app.action().await.1, before);
        let (status, observed) = observe(&app, &app.session, period, returns[period - 1]).await;
        assert_eq!((status, &observed["completed"]), (StatusCode::OK, &json!(false)), "{observed}");
    }
    // As many periods past the horizon as the policy has, and no more.
    assert_eq!(observe(&app, &app.session, 6, 0.01).await.0, 200);
    assert_eq!(observe(&app, &app.session, 7, 0.01).await.0, 409);
    app.cancel(&busy).await;
    let renewed = async || {
        let now = session(&app, &app.session).await;
        (now["renewals"] == 1).then_some(now)
    };
    let now = until("the session to be renewed", renewed).await;
    assert_eq!(json!([now["state"], now["period"], now["horizon"]]), json!(["active", 7, 9]));
    assert!(app.action().await.1["caution"].as_array().unwrap().iter().all(|caution| caution["code"] != "waiting"));
    let replayed = app.action().await.1;
    app.restart().await;
    assert_eq!(app.action().await.1, replayed);
}
