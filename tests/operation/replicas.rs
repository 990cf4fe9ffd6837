//! Real processes over one PostgreSQL database: any of them may be killed, stopped or raced, and so may the database.

use std::process::{Child, Command};
use std::time::{Duration, Instant};

use crate::support::patience::{assert_within, until};
use crate::support::postgres::{database, private_cluster};
use crate::support::process::{serve, steps_solved};
use crate::support::values::number;
use crate::support::{App, several_assets, specification};
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::store::{JobRow, Store};
use futures_util::future::{FutureExt, join_all};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};

/// Long enough for a loaded machine to renew the lease in, short enough to wait for.
const LEASE: Duration = Duration::from_secs(3);
/// Trainings that last for seconds, so that a fault or a check every second falls inside.
const STEPS: usize = 120;

struct Replica {
    child: Child,
    app: App,
}

impl Replica {
    fn start(store: &str, role: &str) -> Replica {
        let (child, url) = serve(|command| {
            command.args(["--role", role, "--training-threads", "1", "--lease-seconds"]);
            command.arg(LEASE.as_secs().to_string()).env("BALLAST_STORE", store);
            // Logging is off, because the many faults caused here would be logged.
            command.env("RUST_LOG", "off");
        });
        Replica { child, app: App::at(url, tempfile::tempdir().unwrap()) }
    }

    fn signal(&self, name: &str) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args([name, &pid]).status().unwrap().success());
    }
}

impl Drop for Replica {
    fn drop(&mut self) {
        // SIGKILL ends a stopped process too.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

async fn row(store: &str, job: &str) -> JobRow {
    let store = Store::connect(&store.parse().unwrap()).await.unwrap();
    let row = store.job(job).await.unwrap().unwrap();
    store.close().await;
    row
}

/// Waits for the job and checks that its policy is the one that a single undisturbed thread trains.
async fn ends_in_the_same_policy(app: &mut App, job: &str) {
    let done = app.until(job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    app.policy = done["policy"].as_str().unwrap().to_owned();
    assert!(app.export().await == crate::support::trained(&specification(STEPS)), "the policies differ");
}

/// Applies `fault` to the worker in the middle of a training; the other takes over from its last finished step.
async fn a_worker_falls_silent(fault: &str) {
    let Some(store) = database().await else { return };
    let mut api = Replica::start(&store, "api");
    let mut workers = [Replica::start(&store, "worker"), Replica::start(&store, "worker")];
    let job = api.app.queue(&specification(STEPS)).await;
    api.app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(2)).await;
    if steps_solved(&workers[1].app.url).await > 0 {
        workers.reverse();
    }
    let [silent, heir] = workers;
    silent.signal(fault);
    let left = row(&store, &job).await;
    ends_in_the_same_policy(&mut api.app, &job).await;
    let ended = row(&store, &job).await;
    assert!(ended.attempt > left.attempt, "{left:?} {ended:?}");
    assert!(steps_solved(&heir.app.url).await <= STEPS - left.steps_done, "finished steps were solved again");
    if fault == "-KILL" {
        return;
    }

    // The worker resumes in the middle of a step of a job that has ended, and continues with the next job.
    silent.signal("-CONT");
    drop(heir);
    let next = api.app.queue(&specification(2)).await;
    let done = api.app.until(&next, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    assert_eq!(row(&store, &job).await, ended, "a stale worker changed a job");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_worker_is_replaced() {
    a_worker_falls_silent("-KILL").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stopped_worker_is_replaced_and_changes_nothing_when_it_wakes() {
    a_worker_falls_silent("-STOP").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_followed_and_cancelled_through_a_replica_that_does_not_run_it() {
    let Some(store) = database().await else { return };
    let (api, worker) = (Replica::start(&store, "api"), Replica::start(&store, "worker"));
    let job = api.app.queue(&specification(STEPS)).await;
    let events = format!("{}/jobs/{job}/events", api.app.url);
    let text = api.app.client.get(&events).send().await.unwrap().text().await.unwrap();
    assert!(text.contains(r#""state":"running""#) && text.contains(r#""state":"succeeded""#), "{text}");
    assert_eq!(steps_solved(&worker.app.url).await, STEPS);

    let job = api.app.queue(&specification(400)).await;
    let following = api.app.client.get(format!("{}/jobs/{job}/events", api.app.url)).send().await.unwrap();
    api.app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(1)).await;
    let started = Instant::now();
    assert_eq!(api.app.cancel(&job).await, 202);
    api.app.until(&job, |job| job["state"] == "cancelled").await;
    assert_within(Duration::from_secs(2), started, "a cancel through another replica");
    let text = following.text().await.unwrap();
    assert!(text.contains("event: state") && text.contains(r#""state":"cancelled""#), "{text}");
    // The worker is free again.
    let next = api.app.queue(&specification(1)).await;
    api.app.until(&next, |job| job["state"] == "succeeded").await;
}

/// Every action of either replica is the simulator's for exactly the returns acknowledged by then.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_lives_on_two_replicas_at_once() {
    const HORIZON: usize = 6;
    let Some(store) = database().await else { return };
    let (mut first, mut second) = (Replica::start(&store, "all"), Replica::start(&store, "api"));
    let mut request = specification(HORIZON);
    // A radius small enough that the robust allocation is not always zero.
    request["problem"]["radius"]["scale"] = json!(0.1);
    first.app.train(&request).await;
    first.app.open().await;
    second.app.session = first.app.session.clone();
    let advisor = Advisor::new(Policy::from_json(&first.app.export().await).unwrap());
    let start = advisor.initial_state(None, None).unwrap();
    let apps = [&first.app, &second.app];

    let mut returns: Vec<f64> = Vec::new();
    for period in 1..=HORIZON {
        let mut expected = returns.clone();
        expected.push(0.0);
        let advices: Vec<_> = advisor.walk(start.clone(), &expected).collect();
        for app in apps {
            let (status, action) = app.action().await;
            assert_eq!((status.as_u16(), &action["period"]), (200, &json!(period)), "{action}");
            assert_eq!(number(&action["allocation"]), advices[period - 1].allocation);
            assert_eq!(number(&action["radius"]), advices[period - 1].radius);
        }
        // Odd periods: eight times the same report. Even ones: eight reports that contradict each other.
        let reports = (0..8).map(|client| {
            let log_return = if period % 2 == 1 { 0.01 } else { 0.01 * (f64::from(client) - 3.5) };
            let app = apps[client as usize % 2];
            async move { app.observe(period, log_return).await }
        });
        let answers = join_all(reports).await;
        let (accepted, refused): (Vec<_>, Vec<_>) = answers.iter().partition(|(status, _)| *status == StatusCode::OK);
        assert_eq!(accepted.len(), if period % 2 == 1 { 8 } else { 1 }, "{answers:?}");
        assert!(accepted.iter().all(|(_, answer)| *answer == accepted[0].1), "{accepted:?}");
        assert!(refused.iter().all(|(_, problem)| problem["type"] == "/problems/report-conflict"), "{refused:?}");
        returns.push(number(&accepted[0].1["log_return"]));
    }
    for app in apps {
        let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
        let stored: Vec<f64> =
            history["observations"].as_array().unwrap().iter().map(|row| number(&row["log_return"])).collect();
        assert_eq!(stored, returns);
        assert_eq!(app.action().await.0, 409);
    }
    assert_eq!(second.app.delete(&format!("/sessions/{}", second.app.session)).await, 204);
    assert_eq!(first.app.action().await.0, 404);
}

/// A fund is composed once a period, through either replica. A report to one replica shows at the other, and a single
/// service with the same reports ends in the same state.
#[tokio::test(flavor = "multi_thread")]
async fn a_fund_lives_on_two_replicas_at_once() {
    const HORIZON: usize = 4;
    let Some(store) = database().await else { return };
    let (mut first, mut second) = (Replica::start(&store, "all"), Replica::start(&store, "api"));
    first.app.train(&several_assets(HORIZON)).await;
    first.app.open().await;
    second.app.session = first.app.session.clone();
    let mut winners = Vec::new();
    for period in 1..=HORIZON {
        let (status, action) = first.app.action().await;
        assert_eq!(status, 200, "{action}");
        assert!(number(&action["total"]) > 0.0, "{action}");
        assert_eq!(second.app.action().await.1, action);
        // Eight reports that contradict each other.
        let apps = [&first.app, &second.app];
        let reports = (0..8).map(|client| {
            let (app, z) = (apps[(client + period) % 2], 0.01 * (client as f64 - 3.5));
            let report = json!({ "log_returns": { "stocks": z, "bonds": 0.004, "gold": -0.5 * z } });
            async move { (app.report(period, report.clone()).await, report) }
        });
        let answers = join_all(reports).await;
        let won: Vec<_> = answers.iter().filter(|((status, _), _)| *status == StatusCode::OK).collect();
        assert_eq!(won.len(), 1, "{answers:?}");
        let ((_, observed), report) = won[0];
        assert_eq!(observed["assets"]["executed_allocations"], action["allocation"]);
        winners.push((action, observed.clone(), report.clone()));
    }
    second.app.policy = first.app.policy.clone();
    second.app.open().await;
    for (period, (advised, observed, report)) in (1..).zip(winners) {
        let (_, action) = second.app.action().await;
        for field in ["allocation", "composition", "certainty_equivalent", "one_step", "trade"] {
            assert_eq!(action[field], advised[field], "{field} of period {period}");
        }
        let (status, alone) = second.app.report(period, report).await;
        assert_eq!((status, &alone["wealth"]), (StatusCode::OK, &observed["wealth"]));
        assert_eq!(alone["assets"], observed["assets"]);
    }
}

/// Eight contradicting corrections and the next period arrive at once, through both replicas. Each number has one
/// winner, and the session equals one that was reported as the history now reads.
#[tokio::test(flavor = "multi_thread")]
async fn corrections_and_observations_of_two_replicas_have_one_order() {
    const HORIZON: usize = 6;
    let Some(store) = database().await else { return };
    let (mut first, mut second) = (Replica::start(&store, "all"), Replica::start(&store, "api"));
    let mut request = specification(HORIZON);
    request["problem"]["radius"]["scale"] = json!(0.1);
    first.app.train(&request).await;
    first.app.open().await;
    second.app.session = first.app.session.clone();
    assert_eq!(first.app.report(1, json!({ "log_return": 0.02, "executed_allocation": 0.5 })).await.0, 200);
    let corrections = format!("/sessions/{}/corrections", first.app.session);
    for round in 1..HORIZON - 1 {
        let apps = [&first.app, &second.app];
        let correcting = (0..8).map(|client| {
            let (app, period, log_return) = (apps[client % 2], client % round + 1, 0.01 * (client as f64 - 3.5));
            let body = json!({ "correction": round, "period": period, "log_return": log_return,
                "executed_allocation": 0.5, "reason": "revised" });
            let corrections = &corrections;
            async move { app.post(corrections, &body).await }.boxed()
        });
        let observing = first.app.report(round + 1, json!({ "log_return": -0.01, "executed_allocation": 0.5 })).boxed();
        let answers = join_all(correcting.chain([observing])).await;
        let (corrected, observed) = answers.split_at(8);
        assert_eq!(observed[0].0, 200, "{observed:?}");
        let won = corrected.iter().filter(|(status, _)| *status == StatusCode::OK).count();
        assert_eq!(won, 1, "{corrected:?}");
        let refused = corrected.iter().filter(|(status, _)| *status != StatusCode::OK);
        refused.for_each(|(_, problem)| assert_eq!(problem["type"], "/problems/report-conflict", "{problem}"));
        assert_eq!(standing(&first.app).await, standing(&second.app).await, "round {round}");
    }
    let (_, history) = second.app.get(&format!("/sessions/{}/history", second.app.session)).await;
    assert_eq!(history["corrections"].as_array().unwrap().len(), HORIZON - 2);
    let corrected = standing(&second.app).await;
    second.app.policy = first.app.policy.clone();
    second.app.open().await;
    for (row, period) in history["observations"].as_array().unwrap().iter().zip(1..) {
        let log_return = if row["now"].is_object() { &row["now"]["log_return"] } else { &row["log_return"] };
        let report = json!({ "log_return": log_return, "executed_allocation": 0.5 });
        assert_eq!(second.app.report(period, report).await.0, 200);
    }
    assert_eq!(standing(&second.app).await, corrected);
}

/// Returns the advice for a session, and its wealth.
async fn standing(app: &App) -> Value {
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    let (status, mut action) = app.action().await;
    assert_eq!(status, 200, "{action}");
    action["session"] = Value::Null;
    json!([session["wealth"], session["period"], session["sample_size"], action])
}

/// Reports periods one after the other, each until it is acknowledged, and returns the answers.
async fn report_all(app: &App, periods: std::ops::RangeInclusive<usize>) -> Vec<Value> {
    let mut answers = Vec::new();
    for period in periods {
        let answer = until("an acknowledgement", async || {
            let (status, answer) = app.observe(period, 0.001 * period as f64).await;
            assert!(status == 200 || status == 503, "{status} {answer}");
            (status == 200).then_some(answer)
        });
        answers.push(answer.await);
    }
    answers
}

#[tokio::test(flavor = "multi_thread")]
async fn a_crash_of_the_database_loses_and_doubles_nothing() {
    let Some(cluster) = private_cluster() else { return };
    let store = cluster.database().await;
    let (mut api, worker) = (Replica::start(&store, "api"), Replica::start(&store, "worker"));
    api.app.train(&specification(STEPS)).await;
    api.app.open().await;
    let mut slow = specification(STEPS);
    slow["design"] = json!({ "count": 30 });
    let job = api.app.queue(&slow).await;
    api.app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(2)).await;
    let reporting = async {
        let before = report_all(&api.app, 1..=STEPS / 2).await;
        [before, report_all(&api.app, STEPS / 2 + 1..=STEPS).await].concat()
    };
    let crashing = async {
        until("some reports", async || {
            let (_, session) = api.app.get(&format!("/sessions/{}", api.app.session)).await;
            (session["period"].as_u64() >= Some(5)).then_some(())
        })
        .await;
        tokio::task::block_in_place(|| cluster.crash());
        let down = [format!("/action?session={}", api.app.session), "/readyz".into(), format!("/jobs/{job}")];
        for path in down {
            let answer = Client::new().get(format!("{}{path}", api.app.url)).send().await.unwrap();
            assert_eq!((answer.status().as_u16(), answer.headers()["retry-after"].to_str().unwrap()), (503, "1"));
            assert_eq!(crate::support::read(answer).await.1["type"], "/problems/overloaded");
        }
        assert_eq!(api.app.get("/livez").await.0, 200);
        tokio::task::block_in_place(|| cluster.recover());
        for replica in [&api, &worker] {
            let app = &replica.app;
            until("readiness", async || (app.get("/readyz").await.0 == 200).then_some(())).await;
        }
    };
    let (answers, ()) = tokio::join!(reporting, crashing);

    let (_, history) = api.app.get(&format!("/sessions/{}/history", api.app.session)).await;
    let rows = history["observations"].as_array().unwrap();
    assert_eq!((rows.len(), answers.len()), (STEPS, STEPS));
    for (period, (row, answer)) in (1..).zip(rows.iter().zip(&answers)) {
        assert_eq!((&row["period"], &row["wealth"]), (&json!(period), &answer["wealth"]), "{row}");
        assert_eq!(api.app.observe(period, 0.001 * period as f64).await, (StatusCode::OK, answer.clone()));
    }
    let done = api.app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    api.app.policy = done["policy"].as_str().unwrap().to_owned();
    assert!(api.app.export().await == crate::support::trained(&slow), "the policies differ");
    for mut replica in [api, worker] {
        assert_eq!(replica.child.try_wait().unwrap(), None, "a replica ended");
        replica.signal("-TERM");
        assert_eq!(replica.child.wait().unwrap().code(), Some(0));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_answers_operators_only_and_a_folder_has_no_roles() {
    for role in ["api", "worker"] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
        command.args(["serve", "--listen", "127.0.0.1:0", "--role", role, "--data"]).arg(folder.path());
        let refused = command.env_remove("BALLAST_STORE").output().unwrap();
        let output = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(1) && output.contains(&format!("role is {role}")), "{output}");
    }
    let Some(store) = database().await else { return };
    let worker = Replica::start(&store, "worker");
    for path in ["/livez", "/readyz", "/health", "/metrics"] {
        assert_eq!(worker.app.get(path).await.0, 200, "{path}");
    }
    let train = worker.app.client.post(format!("{}/train", worker.app.url)).json(&specification(1));
    let (status, problem) = crate::support::read(train.send().await.unwrap()).await;
    assert_eq!((status.as_u16(), &problem["type"]), (404, &json!("/problems/unknown-route")));
}
