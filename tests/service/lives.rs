//! The life of a training, a policy and a session, over HTTP.

use std::time::{Duration, Instant};

use crate::support::patience::assert_within;
use crate::support::{App, specification};
use reqwest::Method;
use serde_json::json;

#[tokio::test(flavor = "multi_thread")]
async fn an_investor_lives_to_the_horizon() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    let (status, policy) = app.get(&format!("/policies/{}", app.policy)).await;
    assert_eq!((status.as_u16(), policy["diagnostics"].as_array().unwrap().len()), (200, 2));
    app.open().await;
    let (_, action) = app.action().await;
    assert_eq!(action["period"], 1);
    let (status, explained) = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await;
    assert!(status == 200 && explained["worst_case"]["sentence"].is_string(), "{explained}");
    let (status, resolved) = app.get(&format!("/action?session={}&mode=resolve", app.session)).await;
    assert!(status == 200 && resolved["source"] == "resolved", "{resolved}");

    let (status, gap) = app.observe(2, 0.01).await;
    assert!(status == 409 && gap["type"] == "/problems/report-gap" && gap["rule"] == "must be 1", "{gap}");
    let (status, first) = app.observe(1, 0.012).await;
    assert_eq!(status, 200, "{first}");
    assert_eq!(first["executed_allocation"], action["allocation"]);
    assert_eq!(app.observe(1, 0.012).await.1, first);
    assert_eq!(app.observe(1, 0.013).await.0, 409);

    app.restart().await;
    assert_eq!(app.observe(1, 0.012).await.1, first);
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!((&session["wealth"], &session["period"]), (&first["wealth"], &json!(2)));
    assert_eq!(app.observe(2, -0.02).await.1["completed"], true);
    assert_eq!(app.observe(3, 0.01).await.0, 409);
    assert_eq!(app.action().await.0, 409);
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(history["observations"].as_array().unwrap().len(), 2);
    assert_eq!(history["observations"][0]["radius"], first["radius"]);

    assert_eq!(app.delete(&format!("/policies/{}", app.policy)).await, 409);
    assert_eq!(app.delete(&format!("/sessions/{}", app.session)).await, 204);
    let (_, document) = app.get(&format!("/policies/{}/export", app.policy)).await;
    assert_eq!(app.delete(&format!("/policies/{}", app.policy)).await, 204);
    assert_eq!(app.get(&format!("/policies/{}", app.policy)).await.0, 404);
    let (status, imported) = app.post("/policies/import", &document).await;
    assert_eq!((status.as_u16(), imported["policy"].as_str()), (201, Some(app.policy.as_str())));
    let (_, metrics) = app.get("/metrics").await;
    for name in [
        "ballast_training_step_duration_seconds",
        "ballast_observe_duration_seconds",
        "ballast_action_duration_seconds",
        "ballast_http_requests_total",
        "ballast_jobs",
        "ballast_sessions",
    ] {
        assert!(metrics.as_str().unwrap().contains(&format!("# HELP {name}")), "{name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_makes_one_job() {
    let app = App::start().await;
    let train = |horizon| {
        let request = app.client.post(format!("{}/train", app.url)).header("Idempotency-Key", "k");
        async move { crate::support::read(request.json(&specification(horizon)).send().await.unwrap()).await }
    };
    let (first, again, other) = (train(2).await, train(2).await, train(3).await);
    assert_eq!((first.0.as_u16(), &first.1["job"]), (202, &again.1["job"]));
    assert_eq!((other.0.as_u16(), &other.1["type"]), (409, &json!("/problems/idempotency-conflict")));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancel_takes_less_than_a_second() {
    let app = App::start().await;
    let job = app.queue(&specification(100)).await;
    app.until(&job, |job| job["state"] == "running").await;
    let started = Instant::now();
    let (status, _) = app.send(Method::POST, &format!("/jobs/{job}/cancel"), None).await;
    assert_eq!(status, 202);
    app.until(&job, |job| job["state"] == "cancelled").await;
    assert_within(Duration::from_secs(1), started, "a cancel");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_survives_a_restart() {
    let mut app = App::start().await;
    let job = app.queue(&specification(6)).await;
    let before = app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(1)).await;
    app.restart().await;
    let (_, after) = app.get(&format!("/jobs/{job}")).await;
    assert!(after["progress"]["steps_done"].as_u64() >= before["progress"]["steps_done"].as_u64(), "{after}");
    let done = app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    app.policy = done["policy"].as_str().unwrap().to_owned();
    assert!(
        app.export().await == crate::support::trained(&specification(6)),
        "resumed and uninterrupted policies differ"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn checkpoints_that_do_not_reach_back_from_the_horizon_are_solved_again() {
    let mut app = App::start().await;
    let job = app.queue(&specification(40)).await;
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(2)).await;
    app.restart_after("DELETE FROM checkpoints WHERE step = 39").await;
    let done = app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!((&done["state"], &done["progress"]["steps_done"]), (&json!("succeeded"), &json!(40)), "{done}");
    app.policy = done["policy"].as_str().unwrap().to_owned();
    assert!(app.export().await == crate::support::trained(&specification(40)), "the policies differ");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_checkpoint_that_cannot_be_saved_fails_the_job_at_once() {
    let app = App::start().await;
    crate::support::execute(
        app.folder(),
        "CREATE TRIGGER refuse BEFORE INSERT ON checkpoints BEGIN SELECT RAISE(ABORT, 'no'); END",
    )
    .await;
    let job = app.queue(&specification(3)).await;
    let failed = app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(failed["state"], "failed", "{failed}");
    assert!(failed["error"].as_str().unwrap().contains("saving a checkpoint"), "{failed}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_store_is_busy_is_tried_again() {
    let app = App::start().await;
    let job = app.queue(&specification(60)).await;
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(1)).await;
    // The service's writer gives up after five seconds, of which nothing outside tells; a step is solved well within two.
    let lock = crate::support::lock_out(app.folder()).await;
    tokio::time::sleep(Duration::from_secs(7)).await;
    lock.give_up().await;
    let done = app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    assert!(crate::support::attempts(app.folder()).await > 1, "it was never given back");
}

/// Large enough that the fit, and the simulation of the design, take longer than a cancel may.
#[tokio::test(flavor = "multi_thread")]
async fn a_cancel_does_not_wait_for_a_long_fit_or_a_large_design() {
    let app = App::start().await;
    let mut fitting = specification(1);
    fitting["design"] = json!({ "count": 1500, "initial_laws": "resampled" });
    let history: Vec<f64> = (0..2000).map(|k| 0.05 * f64::from(k).sin()).collect();
    let mut simulating = specification(30);
    simulating["problem"]["history"] = json!(history);
    simulating["design"] = json!({ "count": 10_000, "initial_laws": "resampled" });
    for (specification, phase) in [(simulating, ""), (fitting, "fitting")] {
        let job = app.queue(&specification).await;
        app.until(&job, |job| job["state"] == "running" && (phase.is_empty() || job["progress"]["phase"] == phase))
            .await;
        let started = Instant::now();
        assert_eq!(app.cancel(&job).await, 202);
        app.until(&job, |job| job["state"] == "cancelled").await;
        assert_within(Duration::from_secs(1), started, "a cancel");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn events_end_with_the_job() {
    let app = App::start().await;
    let job = app.queue(&specification(2)).await;
    let events = format!("{}/jobs/{job}/events", app.url);
    let text = app.client.get(&events).send().await.unwrap().text().await.unwrap();
    assert!(text.contains("event: progress") && text.contains("succeeded"), "{text}");
    let last = text.lines().filter_map(|line| line.strip_prefix("id: ")).next_back().unwrap();
    let again = app.client.get(&events).header("Last-Event-ID", last).send().await.unwrap();
    assert_eq!(again.status(), 204);
}
