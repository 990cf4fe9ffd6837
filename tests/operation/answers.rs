//! Every answer that may be large reserves its size in one budget before it is made. Each operation of the description
//! is called for its largest answer. In a development build an answer above 64 KB without a reservation ends the call
//! with 500.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::support::{App, labelled, labels};

/// Answers up to this size are not counted.
const COUNTED_FROM: usize = 64 << 10;

fn returns(count: usize) -> Vec<f64> {
    (0..count).map(|k| 0.004 + 0.02 * (1.7 * k as f64).sin()).collect()
}

/// A store with everything that the largest answers contain.
struct Store {
    app: App,
    /// A training that has ended, and an evaluation.
    jobs: [String; 2],
    /// A policy with a long history.
    policy: String,
    /// The policy of a declared problem with a long history.
    declared: String,
    /// A session of many periods.
    session: String,
    /// The path of a subscription.
    subscription: String,
    /// A link to the letter of the session.
    link: Value,
}

impl Store {
    async fn filled() -> Store {
        let mut app = App::start().await;
        let problem = json!({ "horizon": 2, "rate_per_step": 0.001, "history": returns(3000),
            "learning": { "kind": "decay", "half_life": 40 }, "radius": { "rule": "bridge", "paths": 100, "scale": 0.1 } });
        let training = labelled(json!({ "problem": problem, "design": { "count": 20, "initial_laws": "resampled" } }));
        app.train(&training).await;
        let trained = app.policy.clone();
        app.open_with(labelled(json!({ "rolling": true }))).await;
        for (period, log_return) in returns(250).into_iter().enumerate() {
            assert_eq!(app.observe(period + 1, log_return).await.0, StatusCode::OK);
        }
        let session = app.session.clone();
        let evaluation =
            json!({ "problem": crate::support::specification(2)["problem"], "frameworks": ["plug_in"], "paths": 200 });
        let (status, accepted) = app.post("/evaluate", &evaluation).await;
        assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
        let evaluated = accepted["job"].as_str().unwrap().to_owned();
        app.until(&evaluated, |job| job["state"] == "succeeded").await;
        let (_, listed) = app.get("/jobs?limit=1000").await;
        let training = listed["jobs"].as_array().unwrap().iter().find(|job| job["kind"] == "train").unwrap()["job"]
            .as_str()
            .unwrap();
        let jobs = [training.to_owned(), evaluated];
        // Enough of each kind to make a list above 64 KB.
        let small: Value = serde_json::from_slice(&crate::support::trained(&crate::support::specification(2))).unwrap();
        for seed in 1..=8 {
            let mut other = small.clone();
            other["specification"]["seed"] = json!(seed);
            let (status, imported) = app.post("/policies/import", &other).await;
            assert_eq!(status, StatusCode::CREATED, "{imported}");
            let policy = format!("/policies/{}", imported["policy"].as_str().unwrap());
            assert_eq!(app.send(Method::PATCH, &policy, Some(&labels())).await.0, StatusCode::OK);
            assert_eq!(
                app.post("/sessions", &labelled(json!({ "policy": imported["policy"] }))).await.0,
                StatusCode::CREATED
            );
            let mut queued = crate::support::specification(2);
            queued["seed"] = json!(seed + 100);
            assert_eq!(app.post("/train", &labelled(queued)).await.0, StatusCode::ACCEPTED);
        }
        let named = format!("/sessions/{session}");
        for round in 0..300 {
            let change = json!({ "name": format!("{round}") });
            assert_eq!(app.send(Method::PATCH, &named, Some(&change)).await.0, StatusCode::OK);
        }
        let (_, document) = app.get(&format!("/sessions/{session}/export")).await;
        std::fs::write(app.folder().join("session.json"), document.to_string()).unwrap();
        let mut stock: Value = serde_json::from_str(include_str!("../../examples/problems/stock.json")).unwrap();
        stock["problem"]["history"] = json!(returns(2000).iter().map(|value| 20.0 + 300.0 * value).collect::<Vec<_>>());
        stock["problem"]["horizon"] = json!(1);
        app.train(&stock).await;
        let declared = std::mem::replace(&mut app.policy, trained.clone());
        let request = json!({ "url": "https://example.com/", "events": ["drift_alarm"] });
        let subscribed = app.post("/subscriptions", &request).await.1;
        let subscription = format!("/subscriptions/{}", subscribed["subscription"].as_str().unwrap());
        let link = app.post(&format!("/sessions/{session}/links"), &json!({})).await.1;
        Store { app, jobs, policy: trained, declared, session, subscription, link }
    }

    /// Returns the largest valid request of an operation, and whether its answer is above 64 KB.
    fn largest(&self, operation: &str) -> (String, Option<Value>, bool) {
        let Store { jobs: [training, evaluation], policy, declared, session, .. } = self;
        let (of_policy, of_session, of_job) =
            (format!("/policies/{policy}"), format!("/sessions/{session}"), format!("/jobs/{training}"));
        let problem =
            json!({ "rate_per_step": 0.001, "history": returns(5000), "radius": { "rule": "fixed", "radius": 0.001 } });
        let of_text = |lines: usize| returns(lines).iter().map(|back| format!("{back:.4}\n")).collect::<String>();
        let body = |path: &str, body: Value| (path.to_owned(), Some(body), false);
        let get = |path: &str| (path.to_owned(), None, false);
        let large = |path: &str| (path.to_owned(), None, true);
        match operation {
            "get /" => get("/"),
            "get /action" => large(&format!("/action?session={session}&explain=worst_case")),
            "post /plan" => ("/plan".into(), Some(json!({ "problem": problem, "paths": 200 })), true),
            "post /advise" => ("/advise".into(), Some(json!({ "problem": problem })), false),
            "post /sleeve" => ("/sleeve".into(), Some(json!({ "problem": problem })), true),
            "get /audit" => large("/audit?limit=1000"),
            "post /backtest" => body(
                "/backtest",
                json!({ "log_returns": returns(60), "rate": 0.002, "periods_per_year": 12, "window": 24, "count": 20 }),
            ),
            "get /dashboard/{file}" => get("/dashboard/inter.woff2"),
            "post /decide" => ("/decide".into(), Some(json!({ "policy": declared })), true),
            "get /docs" => get("/docs"),
            "get /docs/{file}" => get("/docs/start.js"),
            "post /evaluate" => body(
                "/evaluate",
                json!({ "problem": crate::support::specification(2)["problem"], "frameworks": ["plug_in"] }),
            ),
            "post /frontier" => body(
                "/frontier",
                json!({ "problem": { "rate_per_step": 0.001, "history": returns(40) }, "resamples": 20, "scales": [0, 1], "block": 3 }),
            ),
            "get /guide" => get("/guide"),
            "get /guide/{file}" => get("/guide/requests"),
            "get /llms.txt" => get("/llms.txt"),
            "get /jobs" => get("/jobs?limit=1000"),
            "get /jobs/{id}" => get(&of_job),
            "delete /jobs/{id}" => get(&of_job),
            "post /jobs/{id}/cancel" => (format!("{of_job}/cancel"), None, false),
            "get /jobs/{id}/events" => get(&format!("{of_job}/events")),
            "get /jobs/{id}/report" => get(&format!("/jobs/{evaluation}/report")),
            "get /health" | "get /key" | "get /livez" | "get /metrics" | "get /readyz" => get(&operation[4..]),
            "post /observe" => {
                let one = |period: usize| json!({ "session": session, "period": period, "log_return": 0.001, "confirm": true });
                let unknown =
                    |k: usize| json!({ "session": format!("session_{k:032x}"), "period": 1, "log_return": 0.001 });
                let reports: Vec<Value> = std::iter::once(one(251)).chain((0..999).map(unknown)).collect();
                ("/observe".into(), Some(json!(reports)), true)
            }
            "post /mcp" => {
                let call = json!({ "name": "get_policy", "arguments": { "id": policy } });
                let body = json!({ "jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": call });
                ("/mcp".into(), Some(body), true)
            }
            "get /openapi.json" => large("/openapi.json"),
            "get /policies" => large("/policies?limit=1000"),
            "post /policies/import" => {
                let small = crate::support::trained(&crate::support::specification(2));
                body("/policies/import", serde_json::from_slice(&small).unwrap())
            }
            "get /policies/{id}" => large(&of_policy),
            "get /policies/{id}/export" => large(&format!("{of_policy}/export")),
            "get /policies/{id}/futures" => get(&format!("{of_policy}/futures?paths=1000")),
            "get /policies/{id}/surface" => get(&format!("{of_policy}/surface")),
            "post /returns" => (
                "/returns".into(),
                Some(
                    json!({ "text": of_text(8000), "choices": { "kind": "simple", "unit": "fraction", "unusual": true } }),
                ),
                true,
            ),
            "get /reports.ics" => get("/reports.ics"),
            "get /sessions" => large("/sessions?limit=1000&count=care"),
            "post /sessions" => body("/sessions", labelled(json!({ "policy": policy, "rolling": true }))),
            "get /sessions/{id}/futures" => get(&format!("{of_session}/futures?paths=1000")),
            "get /sessions/{id}" | "delete /sessions/{id}" => get(&of_session),
            "patch /sessions/{id}" => body(&of_session, labels()),
            "delete /policies/{id}" => get(&of_policy),
            "patch /policies/{id}" => body(&of_policy, labels()),
            "post /sessions/{id}/corrections" => body(
                &format!("{of_session}/corrections"),
                json!({ "correction": 1, "period": 3, "log_return": 0.002, "reason": "\u{10348}".repeat(200), "confirm": true }),
            ),
            "get /sessions/{id}/export" => large(&format!("{of_session}/export")),
            // The session is there: it is replayed, and then refused.
            "post /sessions/import" => {
                let document = std::fs::read_to_string(self.app.folder().join("session.json")).unwrap();
                body("/sessions/import", serde_json::from_str(&document).unwrap())
            }
            "get /sessions/{id}/history" => large(&format!("{of_session}/history")),
            "post /sessions/{id}/letter" => {
                let logo = format!("data:image/jpeg;base64,/9j/{}", "A".repeat(270_000));
                let letter = format!("{of_session}/letter?sensitivity=true");
                (letter, Some(json!({ "firm": { "logo": logo } })), true)
            }
            "get /letter" => get(self.link["path"].as_str().unwrap()),
            "get /sessions/{id}/links" => get(&format!("{of_session}/links")),
            "post /sessions/{id}/links" => body(&format!("{of_session}/links"), json!({})),
            "delete /links/{id}" => get(&format!("/links/{}", self.link["link"].as_str().unwrap())),
            "post /sessions/{id}/renewals" => {
                body(&format!("{of_session}/renewals"), json!({ "renewal": 1, "policy": policy }))
            }
            "get /subscriptions" => get("/subscriptions"),
            "post /subscriptions" => {
                body("/subscriptions", json!({ "url": "https://example.com/", "events": ["drift_alarm"] }))
            }
            "post /subscriptions/{id}/secret" => (format!("{}/secret", self.subscription), None, false),
            "post /subscriptions/{id}/resend" => (format!("{}/resend", self.subscription), None, false),
            "delete /subscriptions/{id}" => get(&self.subscription),
            "post /train" => body("/train", labelled(json!({ "problem": problem, "design": { "count": 20 } }))),
            "post /orders" => body(
                "/orders",
                json!({ "session": session, "prices": { "asset": 10.0 }, "units": { "asset": 3.0 }, "cash": 70.0 }),
            ),
            "post /what-if" => {
                let range = json!({ "from": 0.01, "to": 2, "points": 30 });
                let body = json!({ "session": session, "sweep": { "radius_scale": range }, "explain": "worst_case" });
                ("/what-if".into(), Some(body), true)
            }
            _ => panic!(
                "{operation} of the description has no largest answer here: what part of the budget does it take?"
            ),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_operation_has_its_part_of_the_budget_before_its_largest_answer_is_made() {
    let store = Store::filled().await;
    let description: Value = serde_json::from_str(&std::fs::read_to_string("api/openapi.json").unwrap()).unwrap();
    let paths = description["paths"].as_object().unwrap();
    let methods = |path: &str| {
        paths[path].as_object().unwrap().keys().map(|method| format!("{method} {path}")).collect::<Vec<_>>()
    };
    let mut operations: Vec<String> = paths.keys().flat_map(|path| methods(path)).collect();
    // Deletions come last, because other operations need what they delete.
    operations.sort_by_key(|operation| operation.starts_with("delete"));
    for operation in operations {
        let (path, body, is_large) = store.largest(&operation);
        let method = operation.split(' ').next().unwrap().to_uppercase();
        let request = store
            .app
            .client
            .request(Method::from_bytes(method.as_bytes()).unwrap(), format!("{}{path}", store.app.url));
        let answer = body.iter().fold(request, |request, body| request.json(body)).send().await.unwrap();
        let status = answer.status();
        let bytes = answer.bytes().await.unwrap();
        // A policy that sessions use is not deleted.
        let is_answered = status.is_success() || status.is_redirection() || status == StatusCode::CONFLICT;
        let text = String::from_utf8_lossy(&bytes[..bytes.len().min(400)]).into_owned();
        assert!(is_answered, "{operation}: {status} {text}");
        assert!(!is_large || bytes.len() > COUNTED_FROM, "{operation}: {} bytes", bytes.len());
        println!("{operation}: {} bytes", bytes.len());
    }
}
