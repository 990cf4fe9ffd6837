//! A folder that moves into PostgreSQL by one command.

use std::process::{Command, Output};

use crate::decide::stock;
use crate::support::{App, execute, postgres, several_assets, specification};
use reqwest::Method;
use serde_json::json;

fn relocate(app: &App, url: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
    command.args(["move", "--from"]).arg(app.folder()).args(["--store", url]).output().unwrap()
}

fn complaint(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_moves_into_a_database_and_goes_on() {
    let Some(url) = postgres::database().await else { return };
    let mut app = App::start().await;
    app.train(&specification(5)).await;
    app.open_with(json!({ "name": "One asset", "tags": ["Moved"] })).await;
    for period in 1..=3 {
        assert_eq!(app.observe(period, 0.01).await.0, 200);
    }
    let right = json!({ "correction": 1, "period": 1, "log_return": 0.05, "reason": "revised" });
    assert_eq!(app.post(&format!("/sessions/{}/corrections", app.session), &right).await.0, 200);
    let path = format!("/sessions/{}", app.session);
    app.train(&stock(3)).await;
    app.open_with(json!({ "name": "A problem in formulas", "tags": ["moved"] })).await;
    assert_eq!(app.report(1, json!({ "noise": 18.5, "executed": { "order": 12.0 } })).await.0, 200);
    let declared = format!("/sessions/{}", app.session);
    app.train(&several_assets(4)).await;
    app.open().await;
    let report = json!({ "log_returns": { "stocks": 0.01, "bonds": 0.002, "gold": -0.01 }, "confirm": true });
    assert_eq!(app.report(1, report).await.0, 200);
    assert_eq!(
        app.send(Method::PATCH, &format!("/policies/{}", app.policy), Some(&json!({ "name": "All" }))).await.0,
        200
    );
    let paths = [
        path.clone(),
        format!("{path}/history"),
        declared.clone(),
        format!("{declared}/history"),
        "/sessions?search=moved&sort=wealth".into(),
        "/jobs".into(),
        format!("/action?session={}", app.session),
        "/policies".into(),
    ];
    let before = shown(&app, &paths).await;

    assert!(complaint(&relocate(&app, &url)).contains("locked"), "the service runs");
    app.halt().await;
    let moved = relocate(&app, &url);
    assert!(moved.status.success(), "{}", String::from_utf8_lossy(&moved.stderr));
    let output = String::from_utf8(moved.stdout).unwrap();
    assert!(output.contains("entries: 6 rows moved") && output.contains("sound"), "{output}");
    assert!(complaint(&relocate(&app, &url)).contains("has rows"), "the database is not empty");

    let store = url.parse().unwrap();
    app.start_over(ballast::service::process::config::StoreLocation::Postgres(store)).await;
    assert_eq!(shown(&app, &paths).await, before);
    let report = json!({ "log_returns": { "stocks": 0.02, "bonds": 0.001, "gold": 0.01 }, "confirm": true });
    assert_eq!(app.report(2, report).await.0, 200);
    // Numbers go on: what is new is listed first.
    app.open_with(json!({ "name": "Moved too" })).await;
    let found = app.get("/sessions?search=moved").await.1;
    assert_eq!(found["sessions"][0]["name"], "Moved too", "{found}");
}

#[tokio::test(flavor = "multi_thread")]
async fn renewals_keys_and_the_audit_move_too() {
    let Some(url) = postgres::database().await else { return };
    let mut app = App::start().await;
    app.train(&specification(6)).await;
    let next = app.policy.clone();
    app.train(&specification(5)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let path = format!("/sessions/{}", app.session);
    let (status, renewed) = app.post(&format!("{path}/renewals"), &json!({ "renewal": 1, "policy": next })).await;
    assert_eq!(status, 200, "{renewed}");
    let key = app.key("default", "admin").await;
    app.enter(&key).await;
    assert_eq!(app.send(Method::PATCH, &path, Some(&json!({ "name": "Renewed" }))).await.0, 200);
    let paths = [
        path.clone(),
        format!("{path}/history"),
        format!("{path}/export"),
        format!("/action?session={}", app.session),
        "/audit?limit=100".into(),
        "/key".into(),
    ];
    let before = shown(&app, &paths).await;
    assert!(before[4]["entries"].as_array().unwrap().len() >= 6, "{}", before[4]);
    app.halt().await;
    let moved = relocate(&app, &url);
    let output = String::from_utf8_lossy(&moved.stdout).into_owned();
    assert!(moved.status.success(), "{output} {}", String::from_utf8_lossy(&moved.stderr));
    for line in ["renewals: 1 rows moved", "access_keys: 1 rows moved", "policies: 2 rows moved"] {
        assert!(output.contains(line), "{output}");
    }
    app.start_over(ballast::service::process::config::StoreLocation::Postgres(url.parse().unwrap())).await;
    assert_eq!(app.get("/key").await.0, 401, "the key is needed there too");
    app.hold(&key);
    assert_eq!(shown(&app, &paths).await, before);
    assert_eq!(app.observe(2, 0.02).await.0, 200);
}

async fn shown(app: &App, paths: &[String]) -> Vec<serde_json::Value> {
    let mut shown = Vec::new();
    for path in paths {
        let (status, answer) = app.get(path).await;
        assert_eq!(status, 200, "{path}: {answer}");
        shown.push(answer);
    }
    shown
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_folder_moves_nothing() {
    let Some(url) = postgres::database().await else { return };
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    app.halt().await;
    execute(app.folder(), "UPDATE sessions SET initial_wealth = 7.0").await;
    assert!(complaint(&relocate(&app, &url)).contains("is damaged"));
    let store = ballast::store::Store::connect(&url.parse().unwrap()).await.unwrap();
    assert_eq!(store.count_sessions().await.unwrap(), 0);
    store.close().await;
}
