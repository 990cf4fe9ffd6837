//! A session that moves to another service or tenant as one document.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::decide::stock;
use crate::support::{App, several_assets, specification};

over_either_store![a_session_goes_on_elsewhere_bit_for_bit, what_is_no_session_is_refused];

/// Opens a session of one asset that is corrected and renewed, one of several assets, and one of a declared problem;
/// returns them with a report that each may get next.
async fn lived(app: &mut App) -> Vec<(String, Value)> {
    let mut sessions = Vec::new();
    app.train(&specification(6)).await;
    let next = app.policy.clone();
    app.train(&specification(5)).await;
    app.open_with(json!({ "name": "One asset", "notes": "Moved\ntwice", "tags": ["a", "b"], "wealth": 2500.0 })).await;
    for (period, log_return) in [0.01, -0.03, 0.021].into_iter().enumerate() {
        assert_eq!(app.observe(period + 1, log_return).await.0, 200);
    }
    let path = format!("/sessions/{}", app.session);
    let right = json!({ "correction": 1, "period": 2, "log_return": 0.05, "reason": "revised" });
    assert_eq!(app.post(&format!("{path}/corrections"), &right).await.0, 200);
    let (status, renewed) = app.post(&format!("{path}/renewals"), &json!({ "renewal": 1, "policy": next })).await;
    assert_eq!(status, 200, "{renewed}");
    assert_eq!(app.report(4, json!({ "log_return": 0.004, "executed_allocation": 0.25 })).await.0, 200);
    let inserted =
        json!({ "correction": 2, "period": 1, "change": "insert", "log_return": 0.002, "reason": "skipped" });
    let (status, answer) = app.post(&format!("{path}/corrections"), &inserted).await;
    assert!(status == 200 || status == 422, "{answer}");
    sessions.push((app.session.clone(), json!({ "log_return": 0.0123 })));

    app.train(&several_assets(4)).await;
    app.open_with(json!({ "holdings": { "stocks": 0.2, "bonds": 0.3, "gold": 0.0 } })).await;
    let prices = |stocks: f64, bonds: f64, gold: Option<f64>| json!({ "stocks": stocks, "bonds": bonds, "gold": gold });
    let (before, after) = (prices(50.0, 20.0, Some(10.0)), prices(50.5, 20.1, Some(9.9)));
    let report = json!({ "prices": after, "previous_prices": before, "confirm": true });
    assert_eq!(app.report(1, report).await.0, 200);
    // A price that does not come leaves a note in the history.
    let (status, answer) = app.report(2, json!({ "prices": prices(51.0, 20.2, None), "confirm": true })).await;
    assert_eq!((status.as_u16(), &answer["notes"][0]["reason"]), (200, &json!("price_missing")), "{answer}");
    let report = json!({ "prices": prices(51.5, 20.1, Some(10.1)), "confirm": true });
    sessions.push((app.session.clone(), report));

    app.train(&stock(4)).await;
    app.open().await;
    assert_eq!(app.report(1, json!({ "noise": 18.5, "executed": { "order": 12.0 } })).await.0, 200);
    assert_eq!(app.report(2, json!({ "noise": 21.0, "confirm": true })).await.0, 200);
    sessions.push((app.session.clone(), json!({ "noise": 19.0, "confirm": true })));
    sessions
}

/// All that a service says of a session.
async fn shown(app: &App, session: &str) -> Vec<Value> {
    let mut shown = Vec::new();
    for path in [
        format!("/sessions/{session}"),
        format!("/sessions/{session}/history"),
        format!("/action?session={session}"),
        format!("/action?session={session}&mode=resolve"),
        format!("/sessions/{session}/export"),
    ] {
        let (status, answer) = app.get(&path).await;
        assert_eq!(status, 200, "{path}: {answer}");
        shown.push(answer);
    }
    shown
}

async fn exported(app: &App, session: &str) -> Value {
    let (status, document) = app.get(&format!("/sessions/{session}/export")).await;
    assert_eq!(status, 200, "{document}");
    document
}

/// Imports every policy of a document.
async fn import_policies(from: &App, to: &App, document: &Value) {
    for policy in document["session"]["policies"].as_array().unwrap() {
        let (status, policy) = from.get(&format!("/policies/{}/export", policy.as_str().unwrap())).await;
        assert_eq!(status, 200);
        assert_eq!(to.post("/policies/import", &policy).await.0, StatusCode::CREATED);
    }
}

async fn a_session_goes_on_elsewhere_bit_for_bit(mut app: App) {
    let sessions = lived(&mut app).await;
    let mut other = App::start().await;
    for (session, _) in &sessions {
        let document = exported(&app, session).await;
        println!(
            "{} entries: {} bytes",
            document["session"]["entries"].as_array().unwrap().len(),
            document.to_string().len()
        );
        let (status, problem) = other.post("/sessions/import", &document).await;
        let missing = &document["session"]["policies"][0];
        assert_eq!(
            (status.as_u16(), &problem["field"], &problem["value"]),
            (404, &json!("policy"), missing),
            "{problem}"
        );
        import_policies(&app, &other, &document).await;
        let (status, imported) = other.post("/sessions/import", &document).await;
        assert_eq!((status, &imported["session"]), (StatusCode::CREATED, &json!(session)), "{imported}");
        assert_eq!(imported, other.get(&format!("/sessions/{session}")).await.1);
        assert_eq!(shown(&other, session).await, shown(&app, session).await);
        let (status, problem) = other.post("/sessions/import", &document).await;
        assert_eq!((status.as_u16(), &problem["type"]), (409, &json!("/problems/in-use")), "{problem}");
    }
    // Both go on alike, also after a restart.
    other.restart().await;
    for (session, report) in sessions {
        (app.session, other.session) = (session.clone(), session.clone());
        let period = app.get(&format!("/sessions/{session}")).await.1["period"].as_u64().unwrap() as usize;
        let answers = (app.report(period, report.clone()).await, other.report(period, report).await);
        assert_eq!((answers.0.0.as_u16(), &answers.0), (200, &answers.1));
        let action = format!("/action?session={session}");
        assert_eq!(app.get(&action).await, other.get(&action).await);
    }
    let found = other.get("/sessions?search=one&tag=b").await.1;
    assert_eq!(found["sessions"].as_array().unwrap().len(), 1, "{found}");
    let audit = other.get("/audit").await.1;
    let imports =
        audit["entries"].as_array().unwrap().iter().filter(|deed| deed.to_string().contains("session.import")).count();
    assert_eq!(imports, 3, "{audit}");
    other.halt().await;
    let check = crate::support::process::ballast(&["check", "--data", other.folder().to_str().unwrap()]);
    assert!(check.status.success(), "{}", String::from_utf8_lossy(&check.stderr));
}

/// A session whose records begin at different dates goes on elsewhere; one that says that they begin where they cannot is refused.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_of_unequal_records_moves_as_it_is() {
    let (mut app, other) = (App::start().await, App::start().await);
    app.train(&several_assets(4)).await;
    let known = |month: usize, asset: usize| 0.01 + 0.03 * (1.7 * ((asset + 1) * month) as f64).sin();
    let row = |month: usize| json!([known(month, 0), known(month, 1), (month >= 15).then(|| known(month, 2))]);
    let history = json!((0..40).map(row).collect::<Vec<Value>>());
    app.open_with(json!({ "history": history, "wealth": 500.0 })).await;
    let document = exported(&app, &app.session).await;
    import_policies(&app, &other, &document).await;
    let plan: Value = serde_json::from_str(document["session"]["start"]["plan"].as_str().unwrap()).unwrap();
    for missing in [json!([0, 1000, 0]), json!([0, 15]), json!([15, 15, 15])] {
        let mut plan = plan.clone();
        plan["assets"]["missing"] = missing.clone();
        let forged = changed(&document, "/session/start/plan", json!(plan.to_string()));
        let (status, problem) = import_sealed(&other, forged).await;
        assert!(status == 422 && problem["field"].as_str().unwrap().starts_with("history"), "{missing}: {problem}");
    }
    let (status, answer) = other.post("/sessions/import", &document).await;
    assert_eq!(status, 201, "{answer}");
    assert_eq!(shown(&other, &app.session).await, shown(&app, &app.session).await);
    let (_, kept) = other.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(kept["history"], history);
}

/// Returns the document with the value at a pointer replaced, under its old hash.
fn changed(document: &Value, pointer: &str, value: Value) -> Value {
    let mut changed = document.clone();
    *changed.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
    changed
}

/// Imports a document under the hash that its refusal names.
async fn import_sealed(app: &App, mut document: Value) -> (StatusCode, Value) {
    let (_, problem) = app.post("/sessions/import", &document).await;
    assert_eq!(problem["field"], "hash", "{problem}");
    document["hash"] = json!(problem["rule"].as_str().unwrap().split("which is ").nth(1).unwrap()[..64]);
    app.post("/sessions/import", &document).await
}

async fn what_is_no_session_is_refused(mut app: App) {
    let sessions = lived(&mut app).await;
    let (session, other) = (&sessions[0].0, App::start().await);
    let document = exported(&app, session).await;
    import_policies(&app, &other, &document).await;
    let text = |pointer: &str| document.pointer(pointer).unwrap().as_str().unwrap().to_owned();
    // Every text with one letter more, and every number with one added, breaks the hash.
    for pointer in [
        "/session/session",
        "/session/labels/name",
        "/session/start/plan",
        "/session/entries/0/content",
        "/session/entries/1/answer",
        "/session/entries/0/key",
    ] {
        let (status, problem) =
            other.post("/sessions/import", &changed(&document, pointer, json!(text(pointer) + "x"))).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("hash")), "{pointer}: {problem}");
    }
    for pointer in [
        "/session/start/history/3",
        "/session/start/account/0",
        "/session/entries/2/created_ms",
        "/session/state/wealth",
    ] {
        let number = document.pointer(pointer).unwrap();
        let more = number
            .as_i64()
            .map_or_else(|| json!(f64::from_bits(number.as_f64().unwrap().to_bits() + 1)), |whole| json!(whole + 1));
        let (status, problem) = other.post("/sessions/import", &changed(&document, pointer, more)).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("hash")), "{pointer}: {problem}");
    }
    // A right hash does not help what no session could be.
    for (pointer, value, field) in [
        ("/session/session", json!("session_1"), "session.session"),
        ("/session/session", json!(format!("session_{:032x}", 7)), "session.entries"),
        ("/session/labels/name", json!("x".repeat(101)), "name"),
        ("/session/start/plan", json!("{}"), "session.start.plan"),
        (
            "/session/start/plan",
            json!(text("/session/start/plan").replacen("\"horizon\":5", "\"horizon\":6", 1)),
            "session.start",
        ),
        ("/session/start/account/0", json!(-7.0), "wealth"),
        ("/session/start/account/0", json!(7.0), "session.entries"),
        ("/session/start/history", json!([0.1]), "history"),
        ("/session/entries/0/kind", json!("note"), "session.entries[0].kind"),
        ("/session/entries/0/numbers", json!("AAAA"), "session.entries[0].numbers"),
        ("/session/entries/0/content", json!("{}"), "session.entries"),
        ("/session/entries/0/answer", json!("{"), "session.entries"),
        ("/session/entries", json!([]), "session.policies"),
        ("/session/state/wealth", json!(7.0), "session.state"),
        ("/session/policies", json!([document["session"]["policies"][0]]), "session.policies"),
    ] {
        let (status, problem) = import_sealed(&other, changed(&document, pointer, value)).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{pointer}: {problem}");
    }
    let mut unknown = document.clone();
    unknown["session"]["colour"] = json!(1);
    let (status, problem) = other.post("/sessions/import", &unknown).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("session.colour")), "{problem}");
    assert_eq!(other.get("/sessions").await.1["sessions"], json!([]), "nothing was stored");
    // Laid out anew it is the same document.
    let pretty = serde_json::to_string_pretty(&document).unwrap();
    let request =
        other.client.post(format!("{}/sessions/import", other.url)).header("content-type", "application/json");
    assert_eq!(request.body(pretty).send().await.unwrap().status(), StatusCode::CREATED);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_moves_between_tenants() {
    let mut app = App::start().await;
    let sessions = lived(&mut app).await;
    let (session, path) = (&sessions[0].0, format!("/sessions/{}", sessions[0].0));
    let document = exported(&app, session).await;
    let policies: Vec<String> =
        document["session"]["policies"].as_array().unwrap().iter().map(|id| id.as_str().unwrap().to_owned()).collect();
    let mut documents = Vec::new();
    for policy in &policies {
        documents.push(app.get(&format!("/policies/{policy}/export")).await.1);
    }
    let before = app.get(&format!("{path}/history")).await;
    let owner = app.key("default", "read,operate").await;
    let heir = app.key("south", "read,operate,train").await;
    app.enter(&heir).await;
    assert_eq!(app.get(&format!("{path}/export")).await.0, StatusCode::NOT_FOUND, "it is another's");
    for policy in &documents {
        assert_eq!(app.post("/policies/import", policy).await.0, StatusCode::CREATED);
    }
    // A session lives in one place: it is deleted there before it comes here.
    assert_eq!(app.post("/sessions/import", &document).await.0, StatusCode::CONFLICT);
    app.hold(&owner);
    assert_eq!(app.send(Method::DELETE, &path, None).await.0, StatusCode::NO_CONTENT);
    app.hold(&heir);
    let (status, imported) = app.post("/sessions/import", &document).await;
    assert_eq!((status, &imported["name"]), (StatusCode::CREATED, &json!("One asset")), "{imported}");
    assert_eq!(app.get(&format!("{path}/history")).await, before);
    app.hold(&owner);
    assert_eq!(app.get(&path).await.0, StatusCode::NOT_FOUND);
}
