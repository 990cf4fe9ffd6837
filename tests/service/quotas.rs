//! The bytes of a tenant are bounded, and unused ones are freed.

use std::time::Duration;

use crate::support::patience::{patience, until};
use crate::support::{App, entry_bytes, execute, postgres, several_assets, specification};
use ballast::service::process::config::StoreLocation;
use ballast::store::{Inspection, Quotas};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

/// A training that takes longer than any test.
fn endless() -> Value {
    let mut endless = specification(500);
    endless["design"] = json!({ "count": 400 });
    endless
}

fn assert_refused((status, problem): (StatusCode, Value), expected: u16, option: &str, value: u64, limit: u64) {
    assert_eq!(status, expected, "{problem}");
    assert_eq!((&problem["field"], &problem["value"]), (&json!(option), &json!(value)), "{problem}");
    let rule = problem["rule"].as_str().unwrap();
    assert!(rule.contains(&format!("at most {limit},")) && rule.contains(&format!("--{option}")), "{problem}");
}

const QUOTAS: Quotas = Quotas { queued_jobs: 2, sessions: 2, bytes: 150_000, audit_entries: 0 };

#[tokio::test]
async fn what_a_tenant_may_keep_is_refused_with_the_numbers() {
    is_refused_with_the_numbers(App::configured(|config| config.quotas = QUOTAS).await).await;
}

#[tokio::test]
async fn so_is_it_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    let store = StoreLocation::Postgres(url.parse().unwrap());
    let app = App::configured(|config| (config.quotas, config.store) = (QUOTAS, store)).await;
    is_refused_with_the_numbers(app).await;
}

async fn is_refused_with_the_numbers(mut app: App) {
    app.train(&specification(2)).await;
    for _ in 0..2 {
        app.open().await;
    }
    let session = json!({ "policy": app.policy });
    assert_refused(app.post("/sessions", &session).await, 413, "quota-sessions", 3, 2);
    assert_eq!(app.observe(1, 0.01).await.0, 200, "a return is never refused for a quota");
    assert_eq!(app.delete(&format!("/sessions/{}", app.session)).await, 204);
    let history = [0.01, -0.01].repeat(9_950);
    let long = json!({ "policy": app.policy, "history": history });
    let (status, problem) = app.post("/sessions", &long).await;
    assert_eq!((status, &problem["field"]), (StatusCode::PAYLOAD_TOO_LARGE, &json!("quota-bytes")), "{problem}");
    app.open().await;

    let running = app.queue(&endless()).await;
    app.until(&running, |job| job["state"] == "running").await;
    let queued = [app.queue(&endless()).await, app.queue(&endless()).await];
    let age = async |state: &str| gauge(&app, &format!("ballast_oldest_job_age_seconds{{state=\"{state}\"}}")).await;
    let both = async || (age("running").await > 0.0 && age("queued").await > 0.0).then_some(());
    until("the oldest jobs to have an age", both).await;
    let refused = app.client.post(format!("{}/train", app.url)).json(&endless()).send().await.unwrap();
    assert!(refused.headers().contains_key("retry-after"));
    assert_refused(app.post("/train", &endless()).await, 429, "quota-queued-jobs", 3, 2);
    assert_eq!(app.post(&format!("/jobs/{}/cancel", queued[0]), &json!({})).await.0, 202);
    app.queue(&endless()).await;
}

/// 30 assets, the longest names, and all that can be reported of a period: what an entry takes is what it is counted with.
#[tokio::test]
async fn an_entry_is_counted_with_what_it_takes_whatever_assets_are_called() {
    let mut app = App::start().await;
    let names: Vec<String> = (0..30).map(|asset| format!("{asset:02}{}", "\u{1F4C8}".repeat(98))).collect();
    let wave = |date: usize, asset: usize| 0.004 + 0.03 * ((7 * date + 11 * asset + 3) as f64).sin();
    let rows: Vec<Vec<f64>> = (0..40).map(|date| (0..30).map(|asset| wave(date, asset)).collect()).collect();
    let mut several = several_assets(3);
    (several["problem"]["assets"], several["problem"]["history"]) = (json!(names), json!(rows));
    app.train(&several).await;
    app.open().await;
    let by_name = |value: &dyn Fn(usize) -> f64| -> Value {
        names.iter().enumerate().map(|(asset, name)| (name.clone(), json!(value(asset)))).collect()
    };
    let report = json!({ "session": app.session, "period": 1, "confirm": true, "date": "2026-01-31", "rate": 0.001234567891234567,
        "flow": -0.1234567891234567, "wealth": 101.23456789123456, "prices": by_name(&|asset| 100.0 / 7.0 + asset as f64),
        "previous_prices": by_name(&|asset| 100.0 / 7.1 + asset as f64),
        "executed_allocations": by_name(&|asset| 1.0 / (40.0 + asset as f64)) });
    let (status, first) = app.post("/observe", &report).await;
    assert_eq!(status, 200, "{first}");
    let plain = json!({ "session": app.session, "period": 2, "confirm": true, "log_returns": by_name(&|asset| wave(41, asset)) });
    assert_eq!(app.post("/observe", &plain).await.0, 200);
    let reason = "\u{1F4C8}".repeat(200);
    let correction = json!({ "correction": 1, "period": 2, "reason": reason, "confirm": true,
        "log_returns": by_name(&|asset| wave(42, asset)) });
    let corrections = format!("/sessions/{}/corrections", app.session);
    let (status, corrected) = app.post(&corrections, &correction).await;
    assert_eq!(status, 200, "{corrected}");
    let bytes = entry_bytes(app.folder()).await;
    assert_eq!(bytes.len(), 3);
    println!("{bytes:?} bytes: all of a period of 30 assets, its returns alone, and a correction");
    assert!(bytes[..2].iter().all(|bytes| *bytes < 4000), "{bytes:?}");
    assert!(bytes[2] < 2 * (1536 + 30 * 88), "{bytes:?}");
    // What is read of them is what was answered.
    assert_eq!(app.post("/observe", &report).await, (StatusCode::OK, first));
    assert_eq!(app.post(&corrections, &correction).await, (StatusCode::OK, corrected));
    let mut other = report;
    other["previous_prices"][&names[0]] = json!(14.0);
    assert_eq!(app.post("/observe", &other).await.0, StatusCode::CONFLICT);
    let (_, advised) = app.action().await;
    app.restart().await;
    assert_eq!(app.action().await, (StatusCode::OK, advised));
    let (mut checked, folder) = (0, Inspection::of_folder(app.folder()).await.unwrap());
    folder.run(&mut |_| checked += 1).await.unwrap();
    assert!(checked > 5, "{checked}");
}

#[tokio::test]
async fn names_with_control_characters_are_refused_with_their_place() {
    let app = App::start().await;
    let mut several = several_assets(2);
    several["problem"]["assets"][1] = json!("bo\u{7}nds");
    let advise = json!({ "problem": { "assets": ["stocks", "bo\u{7}nds"], "rate_per_step": 0.001, "history": [[0.1, 0.0], [0.0, 0.1]] } });
    for (path, body) in [("/train", several), ("/advise", advise)] {
        let (status, refused) = app.post(path, &body).await;
        assert_eq!(
            (status, &refused["field"]),
            (StatusCode::UNPROCESSABLE_ENTITY, &json!("problem.assets[1]")),
            "{refused}"
        );
        let rule = refused["rule"].as_str().unwrap();
        assert!(rule.contains("letter 3 is U+0007") && rule.contains("remove it"), "{rule}");
    }
}

#[tokio::test]
async fn an_ended_job_is_deleted_with_its_key_and_one_that_has_not_ended_is_not() {
    let app = App::start().await;
    let train = async |specification: &Value| {
        let request = app.client.post(format!("{}/train", app.url)).header("idempotency-key", "once");
        let job: Value = request.json(specification).send().await.unwrap().json().await.unwrap();
        job["job"].as_str().unwrap().to_owned()
    };
    let first = train(&specification(2)).await;
    let path = format!("/jobs/{first}");
    let done = app.until(&first, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(train(&specification(2)).await, first, "the key is good as long as its job is there");
    // A cancel that comes too late costs nothing.
    assert_eq!(app.post(&format!("{path}/cancel"), &json!({})).await.1["state"], "succeeded");
    assert_eq!(app.delete(&path).await, 204);
    assert_eq!(app.get(&path).await.0, 404);
    assert_eq!(app.delete(&path).await, 404);
    assert_eq!(app.get(&format!("/policies/{}", done["policy"].as_str().unwrap())).await.0, 200);
    assert_ne!(train(&specification(2)).await, first);

    let running = app.queue(&endless()).await;
    app.until(&running, |job| job["state"] == "running").await;
    let (status, problem) = app.send(Method::DELETE, &format!("/jobs/{running}"), None).await;
    assert_eq!((status, &problem["type"]), (StatusCode::CONFLICT, &json!("/problems/job-not-ended")));
    assert_eq!(app.post(&format!("/jobs/{running}/cancel"), &json!({})).await.0, 202);
    app.until(&running, |job| job["state"] == "cancelled").await;
    assert_eq!(app.delete(&format!("/jobs/{running}")).await, 204);
}

async fn gauge(app: &App, name: &str) -> f64 {
    let page = app.client.get(format!("{}/metrics", app.url)).send().await.unwrap().text().await.unwrap();
    let line = page.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ').map(str::to_owned));
    line.unwrap_or_else(|| panic!("no {name} in\n{page}")).parse().unwrap()
}

/// 64 ended jobs with a report of a megabyte each, of a long time ago.
const REPORTS: [&str; 2] = [
    "WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < 64)
     INSERT INTO jobs (job, tenant, kind, state, steps_total, created_ms, finished_ms)
     SELECT 'old_' || n, 'default', 'evaluate', 'succeeded', 1, 1, 2 FROM numbers",
    "INSERT INTO job_reports (job, json) SELECT job, printf('%.*c', 1000000, 'x') FROM jobs WHERE job LIKE 'old_%'",
];

#[tokio::test]
async fn ended_jobs_expire_and_the_room_they_took_goes_back() {
    let mut app = App::start().await;
    let recent = app.queue(&specification(2)).await;
    app.until(&recent, |job| job["finished_ms"].is_i64()).await;
    for statement in REPORTS {
        execute(app.folder(), statement).await;
    }
    let before = gauge(&app, "ballast_store_bytes").await;
    assert!(before > 60e6, "{before}");
    // The store is tidied at the start and each minute.
    app.restart().await;
    let deadline = std::time::Instant::now() + patience();
    loop {
        let [size, free] = [gauge(&app, "ballast_store_bytes").await, gauge(&app, "ballast_store_free_bytes").await];
        if size < 8e6 && free <= (4 << 20) as f64 {
            break;
        }
        assert!(std::time::Instant::now() < deadline, "still {size} bytes, {free} of them free");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let (_, page) = app.get("/jobs").await;
    assert_eq!((page["jobs"].as_array().unwrap().len(), &page["jobs"][0]["job"]), (1, &json!(recent)));
    assert!(gauge(&app, "ballast_store_log_bytes").await <= (64 << 20) as f64);
    assert!(gauge(&app, "ballast_disk_left_bytes").await > 0.0);
}
