//! Links: whoever has one reads the present letter of one session, and nothing else, until it expires or is deleted.

use crate::support::{App, specification};
use ballast::store::{LinkRow, Linking, MOST_LINKS, Store, Tenant};
use reqwest::Method;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

async fn make(app: &App, request: Value) -> (u16, Value) {
    let (status, made) = app.post(&format!("/sessions/{}/links", app.session), &request).await;
    (status.as_u16(), made)
}

/// Opens an address without a key, as a client's browser does.
async fn read(app: &App, path: &str) -> (u16, reqwest::header::HeaderMap, String) {
    let response = reqwest::get(format!("{}{path}", app.url)).await.unwrap();
    let (status, headers) = (response.status().as_u16(), response.headers().clone());
    (status, headers, response.text().await.unwrap())
}

async fn live(app: &mut App) {
    app.train(&specification(3)).await;
    app.open_with(json!({ "name": "Ada" })).await;
}

async fn over_either(story: impl AsyncFn(App)) {
    story(App::start().await).await;
    if let Some(app) = App::over_a_database().await {
        story(app).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_shows_the_present_letter_of_one_session_without_a_key() {
    over_either(async |mut app| {
        let key = app.key("north", "admin").await;
        app.enter(&key).await;
        live(&mut app).await;
        let firm = json!({ "name": "North & Sons", "closing": "Call us." });
        let (status, made) = make(&app, json!({ "days": 3, "letter": { "firm": firm, "currency": "EUR" } })).await;
        assert_eq!(status, 201, "{made}");
        let path = made["path"].as_str().unwrap();
        let (status, headers, letter) = read(&app, path).await;
        assert_eq!(status, 200, "{letter}");
        assert!(["Ada", "North &amp; Sons", "Call us.", "EUR"].iter().all(|part| letter.contains(part)), "{letter}");
        assert_eq!(headers["referrer-policy"], "no-referrer");
        assert_eq!(
            (&headers["cache-control"], &headers["x-robots-tag"]),
            (&"no-store".parse().unwrap(), &"noindex".parse().unwrap())
        );
        assert!(headers["content-security-policy"].to_str().unwrap().contains("default-src 'none'"));
        // It follows the session.
        assert_eq!(app.observe(1, 0.02).await.0, 200);
        let later = read(&app, path).await.2;
        assert!(later != letter && later.contains("How it went"), "{later}");
        // The secret is no key, and is kept nowhere.
        let secret = path.split('=').nth(1).unwrap();
        assert_eq!(
            reqwest::Client::new()
                .get(format!("{}/sessions", app.url))
                .bearer_auth(secret)
                .send()
                .await
                .unwrap()
                .status(),
            401
        );
        let (_, listed) = app.get(&format!("/sessions/{}/links", app.session)).await;
        assert_eq!(listed["links"].as_array().unwrap().len(), 1);
        assert_eq!(
            (&listed["links"][0]["link"], &listed["links"][0]["expires_ms"]),
            (&made["link"], &made["expires_ms"])
        );
        assert!(!listed.to_string().contains(secret));
        // Another tenant neither sees nor deletes it, nor makes one.
        let [own, south] = [app.session.clone(), app.key("south", "operate,train,read").await];
        app.enter(&south).await;
        assert_eq!(app.get(&format!("/sessions/{own}/links")).await.0, 404);
        assert_eq!(app.post(&format!("/sessions/{own}/links"), &json!({})).await.0, 404);
        let delete = format!("/links/{}", made["link"].as_str().unwrap());
        assert_eq!(app.delete(&delete).await, 404);
        app.enter(&key).await;
        assert_eq!(read(&app, path).await.0, 200);
        assert_eq!(app.delete(&delete).await, 204);
        assert_eq!((read(&app, path).await.0, app.delete(&delete).await.as_u16()), (404, 404));
        let (_, audit) = app.get(&format!("/audit?object={own}")).await;
        let actions: Vec<&str> =
            audit["entries"].as_array().unwrap().iter().map(|entry| entry["action"].as_str().unwrap()).collect();
        assert!(actions.starts_with(&["session.unlink", "session.observe", "session.link"]), "{actions:?}");
    })
    .await;
}

fn stored(session: &str, secret: &str, (created_ms, expires_ms): (i64, i64)) -> LinkRow {
    LinkRow {
        link: format!("link_{created_ms}"),
        session: session.to_owned(),
        hash: Sha256::digest(secret).into(),
        letter_json: "{}".to_owned(),
        created_ms,
        expires_ms,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_ends_by_its_time_and_with_its_session() {
    over_either(async |mut app| {
        live(&mut app).await;
        let (session, secret) = (app.session.clone(), "a".repeat(64));
        app.between(async |store: &Store| {
            let expired = stored(&session, &secret, (1, 2));
            assert_eq!(store.create_link(&Tenant::default(), expired).await.unwrap(), Linking::Created);
        })
        .await;
        let (status, _, page) = read(&app, &format!("/letter?link={secret}")).await;
        assert!(status == 404 && page.starts_with("<!doctype html>") && page.contains("expired"), "{page}");
        let unknown = read(&app, &format!("/letter?link={}", "b".repeat(64))).await;
        assert_eq!((unknown.0, unknown.2), (404, page), "an expired link is as an unknown one");
        for wrong in ["", "a", "%00", &"A".repeat(65), &"\u{e9}".repeat(32)] {
            assert_eq!(read(&app, &format!("/letter?link={wrong}")).await.0, 404, "{wrong}");
        }
        assert_eq!(read(&app, "/letter").await.0, 400);
        // The expired one makes room.
        for _ in 0..MOST_LINKS {
            assert_eq!(make(&app, json!({})).await.0, 201);
        }
        let (status, full) = make(&app, json!({})).await;
        assert_eq!((status, &full["field"]), (422, &json!("links")), "{full}");
        let path = app.get(&format!("/sessions/{session}/links")).await.1["links"][0]["link"].clone();
        assert_eq!(app.delete(&format!("/links/{}", path.as_str().unwrap())).await, 204);
        let last = make(&app, json!({})).await.1["path"].as_str().unwrap().to_owned();
        assert_eq!(read(&app, &last).await.0, 200);
        assert_eq!(app.delete(&format!("/sessions/{session}")).await, 204);
        assert_eq!(read(&app, &last).await.0, 404);
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_that_was_turned_to_another_session_leads_nowhere() {
    let mut app = App::start().await;
    live(&mut app).await;
    let path = make(&app, json!({})).await.1["path"].as_str().unwrap().to_owned();
    let (_, other) = app.post("/sessions", &json!({ "policy": app.policy, "name": "Grace" })).await;
    assert!(other["session"].is_string());
    app.restart_after("UPDATE links SET session = (SELECT session FROM sessions ORDER BY sequence DESC LIMIT 1)").await;
    let (status, _, page) = read(&app, &path).await;
    assert!(status == 500 && !page.contains("Grace"), "{status}: {page}");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_out_of_range_is_named() {
    let mut app = App::start().await;
    live(&mut app).await;
    let logo = "data:image/png;base64,iVBORw0KGgo=";
    for (field, request) in [
        ("days", json!({ "days": 0 })),
        ("days", json!({ "days": 401 })),
        ("letter.currency", json!({ "letter": { "currency": "euro" } })),
        ("letter.date", json!({ "letter": { "date": "2026-01-31" } })),
        ("letter.firm.logo", json!({ "letter": { "firm": { "logo": logo } } })),
        ("letter.firm.name", json!({ "letter": { "firm": { "name": "x".repeat(81) } } })),
        ("hours", json!({ "hours": 1 })),
    ] {
        let (status, refused) = make(&app, request.clone()).await;
        assert_eq!((status, &refused["field"]), (422, &json!(field)), "{request}: {refused}");
    }
    let nobody = app.send(Method::POST, "/sessions/session_of_nobody/links", Some(&json!({}))).await;
    assert_eq!(nobody.0, 404);
}
