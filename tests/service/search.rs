//! A search of sessions finds the beginnings of words.

use crate::support::{App, specification};
use reqwest::{Method, Url};
use serde_json::json;

/// The names of the sessions found, newest first.
async fn found(app: &App, search: &str) -> Vec<String> {
    let url = Url::parse_with_params(&format!("{}/sessions", app.url), [("search", search), ("count", "total")]);
    let page: serde_json::Value = app.client.get(url.unwrap()).send().await.unwrap().json().await.unwrap();
    let rows = page["sessions"].as_array().unwrap_or_else(|| panic!("{search}: {page}"));
    assert_eq!(page["total"].as_u64(), Some(rows.len() as u64), "{search}: {page}");
    rows.iter().map(|row| row["name"].as_str().unwrap().to_owned()).collect()
}

async fn call(app: &App, path: &str, labels: serde_json::Value) {
    assert_eq!(app.send(Method::PATCH, path, Some(&labels)).await.0, 200);
}

over_either_store!(a_search_finds_beginnings_of_words);

async fn a_search_finds_beginnings_of_words(mut app: App) {
    app.train(&specification(3)).await;
    let first_policy = app.policy.clone();
    call(&app, &format!("/policies/{first_policy}"), json!({ "name": "World, monthly" })).await;
    app.open_with(json!({ "name": "US-Equity growth", "tags": ["Pension fund"] })).await;
    let first = app.session.clone();
    let mut other = specification(3);
    other["seed"] = json!(7);
    app.train(&other).await;
    app.open_with(json!({ "name": "growing \u{c9}t\u{e9}" })).await;
    let second = app.session.clone();
    for (search, expected) in [
        ("gro", vec!["growing \u{c9}t\u{e9}", "US-Equity growth"]),
        ("GROWTH", vec!["US-Equity growth"]),
        ("rowth", vec![]),
        ("equity us", vec!["US-Equity growth"]),
        ("us-eq fun", vec!["US-Equity growth"]),
        ("us mon", vec!["US-Equity growth"]),
        ("us \u{e9}t", vec![]),
        ("\u{e9}T", vec!["growing \u{c9}t\u{e9}"]),
        // Without its accents.
        ("ete", vec!["growing \u{c9}t\u{e9}"]),
        ("world", vec!["US-Equity growth"]),
        ("%", vec![]),
        (&first, vec!["US-Equity growth"]),
        (&second["session_".len()..][..10], vec!["growing \u{c9}t\u{e9}"]),
        (&first_policy[..12], vec!["US-Equity growth"]),
    ] {
        assert_eq!(found(&app, search).await, expected, "{search}");
    }

    call(&app, &format!("/sessions/{first}"), json!({ "name": "Bonds growth", "tags": [] })).await;
    for (search, expected) in [("equity", vec![]), ("pension", vec![]), ("bon growth", vec!["Bonds growth"])] {
        assert_eq!(found(&app, search).await, expected, "{search}");
    }
    // By the policy that advises it now.
    let renewal = json!({ "renewal": 1, "policy": app.policy });
    for period in 1..=3 {
        let report = json!({ "session": first, "period": period, "log_return": 0.01, "confirm": true });
        assert_eq!(app.post("/observe", &report).await.0, 200);
    }
    assert_eq!(app.post(&format!("/sessions/{first}/renewals"), &renewal).await.0, 200);
    assert_eq!(found(&app, "world").await, [""; 0]);
    assert_eq!(found(&app, &app.policy[..12]).await, ["growing \u{c9}t\u{e9}", "Bonds growth"]);
    assert_eq!(app.delete(&format!("/sessions/{first}")).await, 204);
    assert_eq!(found(&app, "bonds").await, [""; 0]);
}
