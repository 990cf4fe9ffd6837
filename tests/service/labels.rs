//! Labels of policies and sessions: given when they are made, changed later, and no part of what they are.

use crate::support::{App, postgres, specification};
use ballast::service::process::config::StoreLocation;
use ballast::store::{Inspection, Quotas};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

/// The three of them, of whatever shows them.
fn labels(shown: &Value) -> Value {
    json!({ "name": shown["name"], "notes": shown["notes"], "tags": shown["tags"] })
}

async fn patch(app: &App, path: &str, change: Value) -> (StatusCode, Value) {
    app.send(Method::PATCH, path, Some(&change)).await
}

/// Sends under an idempotency key.
async fn keyed(app: &App, path: &str, body: &Value) -> (StatusCode, Value) {
    let request = app.client.post(format!("{}{path}", app.url)).header("idempotency-key", "once").json(body);
    crate::support::read(request.send().await.unwrap()).await
}

fn called(mut request: Value, called: &Value) -> Value {
    request.as_object_mut().unwrap().extend(called.as_object().unwrap().clone());
    request
}

async fn a_policy_is_called(app: &mut App) {
    let first = json!({ "name": "World, monthly", "notes": "Two\nlines.", "tags": ["équité", "b"] });
    let (status, job) = keyed(app, "/train", &called(specification(2), &first)).await;
    assert_eq!(status, 202, "{job}");
    // Labels are no part of what is trained: neither of the key's request nor of the policy's name.
    let (status, again) = keyed(app, "/train", &called(specification(2), &json!({ "name": "Another" }))).await;
    assert_eq!((status.as_u16(), &again["job"]), (202, &job["job"]));
    let done = app.until(job["job"].as_str().unwrap(), |job| job["finished_ms"].is_i64()).await;
    app.train(&specification(2)).await;
    assert_eq!(done["policy"], json!(app.policy));
    let path = format!("/policies/{}", app.policy);
    assert_eq!(labels(&app.get(&path).await.1), first);
    assert_eq!(labels(&app.get("/policies").await.1["policies"][0]), first);

    let (status, changed) = patch(app, &path, json!({ "name": "World", "tags": null })).await;
    assert_eq!((status.as_u16(), &changed), (200, &json!({ "name": "World", "notes": "Two\nlines.", "tags": [] })));
    assert_eq!(labels(&app.get(&path).await.1), changed);
    assert_eq!(patch(app, &path, json!({})).await.1, changed);
    let id = app.queue(&called(specification(2), &json!({ "tags": ["again"] }))).await;
    app.until(&id, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(app.get(&path).await.1["tags"], json!(["again"]), "given anew with a training");
    assert_eq!(app.get(&path).await.1["name"], "World");
    let (_, audit) = app.get(&format!("/audit?object={}", app.policy)).await;
    assert_eq!(
        (&audit["entries"][0]["action"], &audit["entries"][0]["outcome"]),
        (&json!("policy.label"), &json!("set name, tags")),
        "{audit}"
    );
}

async fn a_session_is_called(app: &mut App) {
    let first = json!({ "name": "Ada", "notes": "", "tags": ["x", "y"] });
    let start = called(json!({ "policy": app.policy }), &first);
    let (status, opened) = keyed(app, "/sessions", &start).await;
    assert_eq!(
        (status.as_u16(), labels(&opened)),
        (409, json!({ "name": null, "notes": null, "tags": null })),
        "a training has the key"
    );
    let (status, opened) = app.post("/sessions", &start).await;
    assert_eq!((status.as_u16(), labels(&opened)), (201, first.clone()));
    let path = format!("/sessions/{}", opened["session"].as_str().unwrap());
    let (status, changed) = patch(app, &path, json!({ "notes": "Reports by post.", "name": "" })).await;
    assert_eq!(
        (status.as_u16(), &changed),
        (200, &json!({ "name": "", "notes": "Reports by post.", "tags": ["x", "y"] }))
    );
    assert_eq!(labels(&app.get(&path).await.1), changed);
    assert_eq!(labels(&app.get("/sessions").await.1["sessions"][0]), changed);
    app.open().await;
    assert_eq!(labels(&app.get("/sessions").await.1["sessions"][0]), json!({ "name": "", "notes": "", "tags": [] }));
    let (_, audit) = app.get(&format!("/audit?object={}", opened["session"].as_str().unwrap())).await;
    assert_eq!(
        (&audit["entries"][0]["action"], &audit["entries"][0]["outcome"]),
        (&json!("session.label"), &json!("set name, notes")),
        "{audit}"
    );
    assert_eq!(app.delete(&path).await, 204);
    assert_eq!(patch(app, &path, json!({ "name": "late" })).await.0, 404);
    assert_eq!(patch(app, "/policies/none", json!({ "name": "late" })).await.0, 404);
}

async fn refused_by_field(app: &mut App) {
    app.open().await;
    let (session, policy) = (format!("/sessions/{}", app.session), format!("/policies/{}", app.policy));
    let tags: Vec<String> = (0..21).map(|tag| tag.to_string()).collect();
    for (labels, field) in [
        (json!({ "name": "x".repeat(101) }), "name"),
        (json!({ "name": "a\u{0}b" }), "name"),
        (json!({ "notes": "x".repeat(2001) }), "notes"),
        (json!({ "notes": "\u{7}" }), "notes"),
        (json!({ "tags": tags }), "tags"),
        (json!({ "tags": ["a", ""] }), "tags[1]"),
        (json!({ "tags": ["a", "a"] }), "tags[1]"),
        (json!({ "tags": "a" }), "tags"),
    ] {
        for (status, problem) in [
            patch(app, &session, labels.clone()).await,
            patch(app, &policy, labels.clone()).await,
            app.post("/train", &called(specification(2), &labels)).await,
            app.post("/sessions", &called(json!({ "policy": app.policy }), &labels)).await,
        ] {
            assert_eq!((status.as_u16(), problem["field"].as_str()), (422, Some(field)), "{problem}");
        }
    }
    assert_eq!(patch(app, &session, json!({ "title": "x" })).await.1["field"], "title");
    assert_eq!(patch(app, &session, json!([null, null, null])).await.1["field"], "body");
}

async fn story(mut app: App) -> App {
    a_policy_is_called(&mut app).await;
    a_session_is_called(&mut app).await;
    refused_by_field(&mut app).await;
    app
}

#[tokio::test(flavor = "multi_thread")]
async fn things_are_called_over_a_folder() {
    let mut app = story(App::start().await).await;
    app.restart().await;
    assert_eq!(app.get(&format!("/policies/{}", app.policy)).await.1["name"], "World");
    // The totals of quotas are what the rows sum to, with labels that came, changed and went.
    Inspection::of_folder(app.folder()).await.unwrap().run(&mut |_| {}).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn things_are_called_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    let location = StoreLocation::Postgres(url.parse().unwrap());
    story(App::configured(|config| config.store = location).await).await;
    Inspection::of_database(&url.parse().unwrap()).await.unwrap().run(&mut |_| {}).await.unwrap();
}

/// A session opened under a key is another request where it is called otherwise.
#[tokio::test]
async fn labels_are_part_of_a_session_s_request_and_of_what_a_tenant_keeps() {
    let quotas = Quotas { bytes: 40_000, ..Quotas::default() };
    let mut app = App::configured(|config| config.quotas = quotas).await;
    app.train(&specification(2)).await;
    let start = json!({ "policy": app.policy, "name": "Ada" });
    let (status, opened) = keyed(&app, "/sessions", &start).await;
    assert_eq!(status, 201, "{opened}");
    assert_eq!(keyed(&app, "/sessions", &start).await.1, opened);
    assert_eq!(keyed(&app, "/sessions", &json!({ "policy": app.policy, "name": "Eve" })).await.0, 409);
    let path = format!("/sessions/{}", opened["session"].as_str().unwrap());
    let mut refused = 0;
    for round in 0..20 {
        app.session = app.post("/sessions", &json!({ "policy": app.policy })).await.1["session"]
            .as_str()
            .unwrap_or_default()
            .to_owned();
        let (status, problem) = patch(&app, &path, json!({ "notes": "€".repeat(100 * round) })).await;
        if status == 413 {
            assert_eq!(problem["field"], "quota-bytes");
            refused += 1;
        }
    }
    assert!(refused > 0, "labels take no room");
    let (status, _) = patch(&app, &path, json!({ "notes": "" })).await;
    assert_eq!(status, 200, "what is cleared gives room back, and is never refused");
}
