//! Who may call what, and who sees what: over either store, and with the real binary.

use std::process::Command;

use crate::support::patience::{self, patience};
use crate::support::process::{self, Process};
use crate::support::{App, issue_key, postgres, read, specification};
use ballast::service::process::config::StoreLocation;
use ballast::store::{KeyRing, KeyRole};
use reqwest::header::{AUTHORIZATION, WWW_AUTHENTICATE};
use reqwest::{Client, Method, StatusCode};
use serde_json::{Value, json};

/// The routes that a service with keys answers without one.
const OPEN: [&str; 11] = [
    "/",
    "/dashboard/{file}",
    "/docs",
    "/docs/{file}",
    "/guide",
    "/guide/{file}",
    // It asks for the secret of a link.
    "/letter",
    "/livez",
    "/llms.txt",
    "/openapi.json",
    "/readyz",
];

/// A service over one of the stores, and keys of it.
struct Guarded {
    app: App,
    store: Option<String>,
}

impl Guarded {
    async fn over_a_folder() -> Guarded {
        Guarded { app: App::start().await, store: None }
    }

    /// `None` where there is no PostgreSQL.
    async fn over_a_database() -> Option<Guarded> {
        let url = postgres::database().await?;
        let location = StoreLocation::Postgres(url.parse().unwrap());
        Some(Guarded { app: App::configured(|config| config.store = location).await, store: Some(url) })
    }

    async fn key(&self, tenant: &str, roles: &str) -> String {
        match &self.store {
            None => self.app.key(tenant, roles).await,
            Some(url) => {
                let ring = KeyRing::connect(&url.parse().unwrap()).await.unwrap();
                issue_key(&ring, tenant, roles).await
            }
        }
    }

    /// Holds the key, the last one made, as soon as the service knows it, and with it all of them.
    async fn hold(&mut self, key: &str) {
        self.app.hold("");
        until("the door to close", async || self.app.get("/no-such-path").await.0 == 401).await;
        self.app.hold(key);
        until("the key to count", async || self.app.get("/no-such-path").await.0 == 404).await;
    }
}

async fn until(what: &str, mut reached: impl AsyncFnMut() -> bool) {
    patience::until(what, async || reached().await.then_some(())).await;
}

/// Every operation of the description: method, path, and the role it asks for, `any` where every key will do.
fn operations() -> Vec<(Method, String, Option<String>)> {
    let description: Value = serde_json::from_str(include_str!("../../api/openapi.json")).unwrap();
    let mut operations = Vec::new();
    for (path, methods) in description["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            let scopes = operation["security"][0]["key"].as_array();
            let role = scopes.map(|scopes| scopes.first().map_or("any", |role| role.as_str().unwrap()).to_owned());
            operations.push((method.to_uppercase().parse().unwrap(), path.clone(), role));
        }
    }
    assert!(operations.len() >= 28, "{operations:?}");
    operations
}

async fn ask(app: &App, method: &Method, path: &str) -> (StatusCode, Option<String>, Value) {
    let request = app.client.request(method.clone(), format!("{}{}", app.url, path.replace(['{', '}'], "")));
    // What is wrong of a message of agents is answered in their protocol and not as a problem document.
    let ping = json!({ "jsonrpc": "2.0", "id": 1, "method": "ping" });
    let body = if path == "/mcp" { ping } else { json!({}) };
    let request = if method == Method::POST { request.json(&body) } else { request };
    let answer = request.send().await.unwrap();
    let scheme = answer.headers().get(WWW_AUTHENTICATE).map(|scheme| scheme.to_str().unwrap().to_owned());
    let (status, body) = read(answer).await;
    (status, scheme, body)
}

async fn every_operation_asks_for_a_key_with_its_role(mut guarded: Guarded) {
    let before = operations();
    for (method, path, role) in &before {
        assert_eq!(role.is_none(), OPEN.contains(&path.as_str()), "{method} {path}");
        let (status, ..) = ask(&guarded.app, method, path).await;
        assert!(status != 401 && status != 403, "{method} {path}: {status} while there are no keys");
    }
    let mut keys = Vec::new();
    for role in KeyRole::ALL.map(KeyRole::as_str) {
        keys.push((role, guarded.key("north", role).await));
    }
    guarded.hold(&keys[3].1).await;
    let mistyped = format!("{}0", &keys[3].1[..keys[3].1.len() - 1]);
    let mistyped = if mistyped == keys[3].1 { format!("{}1", &mistyped[..mistyped.len() - 1]) } else { mistyped };
    for (method, path, needed) in &before {
        for shown in ["", "nonsense", &mistyped] {
            guarded.app.hold(shown);
            let (status, scheme, problem) = ask(&guarded.app, method, path).await;
            assert_eq!(status == 401, needed.is_some(), "{method} {path} with '{shown}': {status}");
            if needed.is_some() {
                assert_eq!(
                    (scheme.as_deref(), &problem["type"]),
                    (Some("Bearer"), &json!("/problems/unauthenticated"))
                );
                assert!(shown.is_empty() || !problem.to_string().contains(shown), "{problem}");
            }
        }
        for (role, key) in &keys {
            guarded.app.hold(key);
            let (status, _, problem) = ask(&guarded.app, method, path).await;
            let may = needed.as_deref().is_none_or(|needed| needed == *role || needed == "any" || *role == "admin");
            assert_eq!(status == 403, !may, "{method} {path} with the role {role}: {status} {problem}");
            assert_ne!(status, 401, "{method} {path} with the role {role}");
            if let (false, Some(needed)) = (may, needed) {
                assert_eq!(problem["type"], "/problems/forbidden");
                assert_eq!(problem["rule"], format!("must be a key with the role {needed}"), "{problem}");
            }
        }
    }
    guarded.app.hold("");
    assert_eq!(ask(&guarded.app, &Method::GET, "/no-such-path").await.0, 401);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_operation_asks_for_a_key_with_its_role_over_a_folder() {
    every_operation_asks_for_a_key_with_its_role(Guarded::over_a_folder().await).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_operation_asks_for_a_key_with_its_role_over_a_database() {
    if let Some(guarded) = Guarded::over_a_database().await {
        every_operation_asks_for_a_key_with_its_role(guarded).await;
    }
}

/// A call and what it answers: status, headers that vary with what was found, body.
async fn answer(app: &App, method: &Method, path: &str, body: &Option<Value>) -> (StatusCode, Vec<String>, Value) {
    let request = app.client.request(method.clone(), format!("{}{path}", app.url));
    let request = body.iter().fold(request, |request, body| request.json(body));
    let answer = request.header("Idempotency-Key", "monthly").send().await.unwrap();
    let mut headers: Vec<String> = answer.headers().keys().map(ToString::to_string).collect();
    headers.sort();
    let (status, body) = read(answer).await;
    (status, headers, body)
}

/// Calls that name a thing of the first tenant.
fn naming(job: &str, evaluation: &str, policy: &str, session: &str) -> Vec<(Method, String, Option<Value>)> {
    let get = |path: String| (Method::GET, path, None);
    let mut calls = vec![
        get(format!("/jobs/{job}")),
        get(format!("/jobs/{job}/events")),
        get(format!("/jobs/{evaluation}/report")),
        get(format!("/policies/{policy}")),
        get(format!("/policies/{policy}/export")),
        get(format!("/policies/{policy}/surface")),
        get(format!("/sessions/{session}")),
        get(format!("/sessions/{session}/history")),
        get(format!("/sessions/{session}/export")),
        get(format!("/sessions/{session}/links")),
        get(format!("/action?session={session}")),
        get(format!("/action?session={session}&mode=resolve")),
        get(format!("/action?session={session}&explain=worst_case")),
    ];
    let body = |path: &str, body: Value| (Method::POST, path.to_owned(), Some(body));
    calls.push(body("/sessions", json!({ "policy": policy })));
    for (period, log_return) in [(1, 0.01), (1, 0.02), (2, 0.01), (9, 0.01)] {
        calls.push(body("/observe", json!({ "session": session, "period": period, "log_return": log_return })));
    }
    calls.push(body("/what-if", json!({ "session": session, "wealth": 50.0 })));
    calls.push(body(
        "/what-if",
        json!({ "session": session, "sweep": { "radius_scale": { "from": 0.0, "to": 1.0, "points": 2 } } }),
    ));
    for path in ["letter", "links"] {
        calls.push(body(&format!("/sessions/{session}/{path}"), json!({})));
    }
    calls.push(body("/decide", json!({ "policy": policy })));
    let problem = json!({ "horizon": 1, "rate_per_step": 0.002, "history": [0.01, -0.02, 0.03] });
    calls.push(body("/evaluate", json!({ "problem": problem, "policies": { "adaptive": policy } })));
    for path in [format!("/jobs/{job}"), format!("/sessions/{session}"), format!("/policies/{policy}")] {
        if !path.starts_with("/jobs") {
            calls.push((Method::PATCH, path.clone(), Some(json!({ "name": "mine" }))));
        }
        calls.push((Method::DELETE, path, None));
    }
    calls
}

async fn another_tenants_things_do_not_exist(mut guarded: Guarded) {
    let (north, south) = (guarded.key("north", "admin").await, guarded.key("south", "admin").await);
    guarded.hold(&south).await;
    let app = &mut guarded.app;
    app.hold(&north);
    app.train(&specification(2)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let (policy, session) = (app.policy.clone(), app.session.clone());
    let (_, jobs) = app.get("/jobs").await;
    let job = jobs["jobs"][0]["job"].as_str().unwrap().to_owned();
    let other = |name: &str| name.chars().rev().collect::<String>();
    let unknown_policy: String = policy.chars().map(|digit| if digit == 'a' { 'b' } else { 'a' }).collect();
    let (unknown_job, unknown_session) =
        (format!("job_{}", other(&job[4..])), format!("session_{}", other(&session[8..])));

    app.hold(&south);
    for list in ["jobs", "policies", "sessions"] {
        let (_, page) = app.get(&format!("/{list}")).await;
        assert_eq!((&page[list], &page["next"]), (&json!([]), &Value::Null), "{page}");
    }
    let theirs = naming(&job, &job, &policy, &session);
    let nobodys = naming(&unknown_job, &unknown_job, &unknown_policy, &unknown_session);
    for ((method, path, body), (_, unknown_path, unknown_body)) in theirs.iter().zip(&nobodys) {
        let of_theirs = answer(app, method, path, body).await;
        let of_nobodys = answer(app, method, unknown_path, unknown_body).await;
        assert!(of_theirs.0 == 404 || path == "/evaluate", "{method} {path}: {of_theirs:?}");
        let renamed = of_nobodys.2.to_string().replace(&unknown_policy, &policy);
        let renamed = renamed.replace(&unknown_job, &job).replace(&unknown_session, &session);
        assert_eq!((of_theirs.0, of_theirs.1), (of_nobodys.0, of_nobodys.1), "{method} {path}");
        assert_eq!(of_theirs.2.to_string(), renamed, "{method} {path}");
    }

    app.hold(&north);
    assert_eq!(app.action().await.0, 200);
    assert_eq!(app.get(&format!("/jobs/{job}")).await.1["state"], "succeeded");
    let (_, history) = app.get(&format!("/sessions/{session}/history")).await;
    assert_eq!(history["observations"].as_array().unwrap().len(), 1);
    let (_, metrics) = app.get("/metrics").await;
    let metrics = metrics.as_str().unwrap();
    // Tenants and names of keys are shown, to admins alone; what they have is not.
    for name in [&policy, &session, &job, &north, &south] {
        assert!(!metrics.contains(name.as_str()), "the metrics name {name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn another_tenants_things_do_not_exist_over_a_folder() {
    another_tenants_things_do_not_exist(Guarded::over_a_folder().await).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn another_tenants_things_do_not_exist_over_a_database() {
    if let Some(guarded) = Guarded::over_a_database().await {
        another_tenants_things_do_not_exist(guarded).await;
    }
}

async fn tenants_may_have_the_same_names_and_policies(mut guarded: Guarded) {
    let (north, south) = (guarded.key("north", "admin").await, guarded.key("south", "train,operate,read").await);
    guarded.hold(&south).await;
    let (app, mut jobs) = (&mut guarded.app, Vec::new());
    for (key, horizon) in [(&north, 1), (&south, 2)] {
        app.hold(key);
        let body = Some(specification(horizon));
        let queued = answer(app, &Method::POST, "/train", &body).await;
        assert_eq!(queued.0, 202, "{queued:?}");
        assert_eq!(answer(app, &Method::POST, "/train", &body).await.2["job"], queued.2["job"]);
        let conflict = answer(app, &Method::POST, "/train", &Some(specification(3))).await;
        assert_eq!(conflict.2["type"], "/problems/idempotency-conflict");
        let job = queued.2["job"].as_str().unwrap().to_owned();
        let done = app.until(&job, |job| job["finished_ms"].is_i64()).await;
        app.policy = done["policy"].as_str().unwrap().to_owned();
        jobs.push(job);
    }
    assert_ne!(jobs[0], jobs[1]);
    // The policy of one, imported by the other: both have it, and each deletes its own.
    let document = serde_json::from_slice(&app.export().await).unwrap();
    app.hold(&north);
    let imported = app.post("/policies/import", &document).await;
    assert_eq!((imported.0.as_u16(), &imported.1["policy"]), (201, &json!(app.policy)));
    assert_eq!(app.get("/policies").await.1["policies"].as_array().unwrap().len(), 2);
    app.open().await;
    app.hold(&south);
    let path = format!("/policies/{}", app.policy);
    assert_eq!(app.delete(&path).await, 204);
    assert_eq!((app.delete(&path).await, app.get(&path).await.0.as_u16()), (StatusCode::NOT_FOUND, 404));
    assert_eq!(app.post("/sessions", &json!({ "policy": app.policy })).await.0, 404);
    app.hold(&north);
    assert_eq!((app.get(&path).await.0.as_u16(), app.action().await.0.as_u16()), (200, 200));
    assert_eq!(app.delete(&path).await, 409);
}

#[tokio::test(flavor = "multi_thread")]
async fn tenants_may_have_the_same_names_and_policies_over_a_folder() {
    tenants_may_have_the_same_names_and_policies(Guarded::over_a_folder().await).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tenants_may_have_the_same_names_and_policies_over_a_database() {
    if let Some(guarded) = Guarded::over_a_database().await {
        tenants_may_have_the_same_names_and_policies(guarded).await;
    }
}

/// Runs `ballast` with these arguments; its exit code, standard output and standard error.
fn ballast(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = process::ballast(arguments);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_made_and_revoked_while_the_service_runs() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap().to_owned();
    let (child, url) = process::serve(|command| {
        command.args(["--data", &data]);
    });
    let (_process, mut app) = (Process(child), App::at(url, folder));
    assert_eq!(app.get("/jobs").await.0, 200);
    let (code, key, stderr) =
        ballast(&["keys", "create", "--tenant", "north", "--role", "read", "--role", "train", "--data", &data]);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(key.starts_with("ballast_") && key.len() == 72 && !stderr.contains(&key), "{stderr}");
    until("the door to close", async || app.get("/jobs").await.0 == 401).await;
    app.hold(&key);
    assert_eq!(app.get("/jobs").await.0, 200);

    let (_, listed, _) = ballast(&["keys", "list", "--data", &data]);
    let row: Vec<&str> = listed.lines().nth(1).unwrap().split('\t').collect();
    assert_eq!((row[1], row[2], row[4], row.len()), ("north", "read,train", "-", 6), "{listed}");
    assert!(!listed.contains(&key), "{listed}");
    let mut slow = specification(400);
    slow["design"] = json!({ "count": 40 });
    let job = app.queue(&slow).await;
    let following = app.client.get(format!("{}/jobs/{job}/events", app.url)).send().await.unwrap();
    assert_eq!(following.status(), 200);
    assert_eq!(ballast(&["keys", "revoke", row[0], "--data", &data]).0, Some(0));
    until("the key to be turned away", async || app.get("/jobs").await.0 == 401).await;
    let heard = tokio::time::timeout(patience(), following.text()).await.expect("the stream ends").unwrap();
    assert!(!heard.contains("succeeded"), "{heard}");
    // Without any key in force the door stays closed.
    app.hold("");
    assert_eq!(app.get("/jobs").await.0, 401);
    let (code, _, stderr) = ballast(&["keys", "revoke", "key_of_nobody", "--data", &data]);
    assert!(code == Some(1) && stderr.contains("there is no key 'key_of_nobody'"), "{stderr}");
    let (code, _, stderr) = ballast(&["keys", "create", "--role", "read", "--tenant", "no spaces", "--data", &data]);
    assert!(code == Some(2) && stderr.contains("letters, digits"), "{stderr}");
}

/// The answer to a key: the status and the problem.
async fn shown(app: &mut App, key: &str) -> (StatusCode, Value) {
    app.hold(key);
    app.get("/jobs").await
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_expire_and_are_rotated_without_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap().to_owned();
    let (child, url) = process::serve(|command| {
        command.args(["--data", &data]);
    });
    let (_process, mut app) = (Process(child), App::at(url, folder));
    let create = |more: &[&str]| {
        let (code, key, stderr) = ballast(&[&["keys", "create", "--role", "admin", "--data", &data], more].concat());
        assert_eq!(code, Some(0), "{stderr}");
        (key, stderr.split(',').next().unwrap().to_owned())
    };
    let (revoked, revoked_name) = create(&[]);
    let (old, old_name) = create(&["--expires-in", "90d"]);
    app.hold(&old);
    until("the key to count", async || app.get("/no-such-path").await.0 == 404).await;
    let mut slow = specification(400);
    slow["design"] = json!({ "count": 40 });
    let job = app.queue(&slow).await;
    let following = app.client.get(format!("{}/jobs/{job}/events", app.url)).send().await.unwrap();

    let (code, new, stderr) = ballast(&["keys", "rotate", &old_name, "--overlap", "6s", "--data", &data]);
    assert!(code == Some(0) && stderr.matches("in force until").count() == 2, "{stderr}");
    app.hold(&new);
    // Never is there a moment in which neither of the two is answered.
    until("the successor to count", async || {
        let answered = app.client.get(format!("{}/jobs", app.url)).bearer_auth(&old).send().await.unwrap();
        app.get("/jobs").await.0 == 200 || answered.status() != 200
    })
    .await;
    assert_eq!(shown(&mut app, &new).await.0, 200, "the old key ended before the new one was known");
    until("the old key to expire", async || shown(&mut app, &old).await.0 == 401).await;
    assert_eq!(shown(&mut app, &new).await.0, 200);
    let heard = tokio::time::timeout(patience(), following.text()).await.expect("the stream ends").unwrap();
    assert!(!heard.contains("succeeded"), "{heard}");
    let (_, listed, _) = ballast(&["keys", "list", "--data", &data]);
    let rows: Vec<Vec<&str>> = listed.lines().skip(1).map(|line| line.split('\t').collect()).collect();
    assert_eq!(rows.len(), 3, "{listed}");
    assert_eq!((rows[1][0], rows[1][5], &rows[1][1..3]), (old_name.as_str(), "-", &rows[2][1..3]), "{listed}");
    assert!(rows[2][4] > rows[1][4] && rows[1][4] < "2100", "as long as the one before was made for: {listed}");

    // What expired says since when, to who holds it; what was revoked is a key like any other that is not in force.
    assert_eq!(ballast(&["keys", "revoke", &revoked_name, "--data", &data]).0, Some(0));
    until("the key to be turned away", async || shown(&mut app, &revoked).await.0 == 401).await;
    let (_, expired) = shown(&mut app, &old).await;
    let value = expired["value"].as_str().unwrap();
    let at: jiff::Timestamp = value.strip_prefix("a key that expired at ").unwrap().parse().unwrap();
    assert!(at < jiff::Timestamp::now() && expired["detail"] == format!("the key expired at {at}"), "{expired}");
    let (_, gone) = shown(&mut app, &revoked).await;
    assert_eq!(gone["value"], "an unknown or revoked key");
    assert_eq!(gone, shown(&mut app, "ballast_0").await.1);
    let (code, _, stderr) = ballast(&["keys", "rotate", &old_name, "--data", &data]);
    assert!(code == Some(1) && stderr.contains("must be in force"), "{stderr}");
    for wrong in [["--expires-in", "0d"], ["--expires-on", "tomorrow"], ["--expires-on", "2001-01-01"]] {
        let (code, _, stderr) = ballast(&[&["keys", "create", "--role", "read", "--data", &data], &wrong[..]].concat());
        assert!(code != Some(0) && stderr.contains("must"), "{stderr}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_address_that_others_reach_asks_for_keys() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap().to_owned();
    let (code, _, stderr) = ballast(&["serve", "--listen", "0.0.0.0:0", "--data", &data]);
    assert!(code == Some(1) && stderr.contains("--tls-cert") && stderr.contains("--allow-plaintext"), "{stderr}");
    let (code, _, stderr) = ballast(&["serve", "--listen", "0.0.0.0:0", "--allow-plaintext", "--data", &data]);
    assert!(
        code == Some(1) && stderr.contains("ballast keys create") && stderr.contains("--allow-anonymous"),
        "{stderr}"
    );
    let public = |allow: Option<(&str, &str)>| {
        let (child, url) = process::serve(|command| {
            command.args(["--listen", "0.0.0.0:0", "--allow-plaintext", "--data", &data]).envs(allow);
        });
        (Process(child), url.replace("0.0.0.0", "127.0.0.1"))
    };
    let (process, url) = public(Some(("BALLAST_ALLOW_ANONYMOUS", "true")));
    assert_eq!(reqwest::get(format!("{url}/jobs")).await.unwrap().status(), 200);
    drop(process);
    // Made while nobody serves the folder.
    let (_, key, _) = ballast(&["keys", "create", "--role", "read", "--data", &data]);
    for allow in [None, Some(("BALLAST_ALLOW_ANONYMOUS", "true"))] {
        let (_process, url) = public(allow);
        assert_eq!(reqwest::get(format!("{url}/jobs")).await.unwrap().status(), 401);
        let held = Client::new().get(format!("{url}/jobs")).header(AUTHORIZATION, format!("bearer {key}"));
        assert_eq!(held.send().await.unwrap().status(), 200);
        assert_eq!(reqwest::get(format!("{url}/readyz")).await.unwrap().status(), 200);
    }
}

/// Uses a key, a wrong one and a key in the wrong place against a service that logs all it can; what it logged.
async fn log_of(configure: impl FnOnce(&mut Command), issue: impl AsyncFnOnce() -> String) -> (String, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let file = std::fs::File::create(&log).unwrap();
    let (child, url) = process::serve(|command| {
        command.env("RUST_LOG", "trace").stderr(file);
        configure(command);
    });
    let (process, mut app) = (Process(child), App::at(url, folder));
    let key = issue().await;
    app.hold("");
    until("the door to close", async || app.get("/jobs").await.0 == 401).await;
    let wrong = format!("ballast_{}", "5ec4e7".repeat(10));
    for shown in [&key, &wrong] {
        app.hold(shown);
        for (method, path, _) in operations() {
            ask(&app, &method, &path).await;
        }
    }
    let basic = app.client.get(format!("{}/jobs", app.url)).header(AUTHORIZATION, format!("Basic {key}"));
    assert_eq!(basic.send().await.unwrap().status(), 401);
    drop(process);
    (std::fs::read_to_string(log).unwrap(), vec![key, wrong])
}

fn assert_no_secret(log: &str, secrets: &[String]) {
    // It did log, each request with a key among the rest.
    assert!(log.lines().any(|line| line.contains("/observe")), "{log}");
    for secret in secrets {
        // A part that is cut out gives as much away.
        let part = &secret[secret.len() - 16..];
        let line = log.lines().find(|line| line.contains(part));
        assert_eq!(line, None, "a secret is in the log");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_secret_is_logged_over_a_folder() {
    let data = tempfile::tempdir().unwrap();
    let (log, secrets) = log_of(
        |command| {
            command.arg("--data").arg(data.path());
        },
        async || issue_key(&KeyRing::open(data.path()).await.unwrap(), "north", "admin").await,
    )
    .await;
    assert_no_secret(&log, &secrets);
}

#[tokio::test(flavor = "multi_thread")]
async fn no_secret_is_logged_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    // The server of the tests trusts whoever comes, so any password will do.
    let password = "open-sesame-to-the-database";
    let with_password =
        if url.contains("ballast@") { url.replace("ballast@", &format!("ballast:{password}@")) } else { url.clone() };
    let (log, mut secrets) = log_of(
        |command| {
            command.env("BALLAST_STORE", &with_password);
        },
        async || issue_key(&KeyRing::connect(&url.parse().unwrap()).await.unwrap(), "north", "admin").await,
    )
    .await;
    secrets.push(password.to_owned());
    assert_no_secret(&log, &secrets);
}
