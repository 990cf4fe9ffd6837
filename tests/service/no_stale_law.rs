//! No advice from a law that has gone out of date, whoever calls what when: over a folder and over a database.
//!
//! Twenty sessions live their thirty periods. Their owners observe and poll; meanwhile strangers with keys of another
//! tenant call every route of sessions by their names, and the store fails by chance, from outside: a table is away for
//! a moment, or the server ends a connection. After every acknowledged period the advice is for the next one.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::support::patience::{patience, until};
use crate::support::{App, issue_key, postgres, specification};
use ballast::service::callers::allowance::Limits;
use ballast::service::process::config::StoreLocation;
use ballast::store::KeyRing;
use futures_util::future::join_all;
use reqwest::{Client, Method, StatusCode};
use serde_json::{Value, json};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{Connection, PgConnection};
use tokio::task::JoinHandle;

const SESSIONS: usize = 20;
const PERIODS: usize = 30;
const POLLERS: usize = 2;
/// At least.
const FAULTS: usize = 10;
/// Between two faults, and how long one lasts.
const SOUND: Duration = Duration::from_millis(25);
const FAULTY: Duration = Duration::from_millis(4);
/// The place that a fault comes from.
#[derive(Clone)]
enum Outside {
    /// The database file of a folder.
    File(PathBuf),
    /// The address of a server.
    Server(String),
}

impl Outside {
    async fn ring(&self) -> KeyRing {
        match self {
            Outside::File(file) => KeyRing::open(file.parent().unwrap()).await.unwrap(),
            Outside::Server(url) => KeyRing::connect(&url.parse().unwrap()).await.unwrap(),
        }
    }

    /// Fails reads and writes now and again until `over`, and counts how often.
    async fn fail(self, over: Arc<AtomicBool>, faults: Arc<AtomicUsize>) {
        while !over.load(Ordering::Relaxed) {
            tokio::time::sleep(SOUND).await;
            match &self {
                Outside::File(file) => hide_entries(file).await,
                Outside::Server(url) => end_a_connection(url).await,
            }
            faults.fetch_add(1, Ordering::Relaxed);
        }
    }
}

async fn hide_entries(file: &PathBuf) {
    let options = SqliteConnectOptions::new().filename(file).busy_timeout(patience());
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::query("ALTER TABLE entries RENAME TO hidden").execute(&mut connection).await.unwrap();
    tokio::time::sleep(FAULTY).await;
    sqlx::query("ALTER TABLE hidden RENAME TO entries").execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

async fn end_a_connection(url: &str) {
    let mut connection = PgConnection::connect(url).await.unwrap();
    let end = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
               WHERE datname = current_database() AND pid <> pg_backend_pid() ORDER BY random() LIMIT 1";
    sqlx::query(end).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

/// A service, and somebody with a key of it.
#[derive(Clone)]
struct Caller {
    client: Client,
    url: String,
    key: String,
}

impl Caller {
    async fn call(&self, method: Method, path: &str, body: Option<Value>) -> (StatusCode, Value) {
        let request = self.client.request(method, format!("{}{path}", self.url)).bearer_auth(&self.key);
        let request = body.iter().fold(request, |request, body| request.json(body));
        let answer = request.send().await.expect("an answer");
        (answer.status(), answer.json().await.unwrap_or_default())
    }

    async fn get(&self, path: &str) -> (StatusCode, Value) {
        self.call(Method::GET, path, None).await
    }

    /// Repeats a call until the store lets it through.
    async fn served(&self, method: Method, path: &str, body: Option<Value>) -> (StatusCode, Value) {
        let deadline = Instant::now() + patience();
        loop {
            let (status, answer) = self.call(method.clone(), path, body.clone()).await;
            if !status.is_server_error() {
                return (status, answer);
            }
            assert!(Instant::now() < deadline, "{path}: still {status}: {answer}");
        }
    }
}

/// A session, and how many of its periods were acknowledged to its owner.
#[derive(Clone)]
struct Life {
    session: String,
    acknowledged: Arc<AtomicUsize>,
}

async fn live(owner: Caller, life: Life) {
    for period in 1..=PERIODS {
        let log_return = 0.02 * (period as f64).sin();
        let report = json!({ "session": life.session, "period": period, "log_return": log_return });
        let (status, answer) = owner.served(Method::POST, "/observe", Some(report)).await;
        assert_eq!((status.as_u16(), &answer["period"]), (200, &json!(period)), "stuck: {answer}");
        life.acknowledged.store(period, Ordering::SeqCst);
        let (status, answer) = owner.served(Method::GET, &format!("/action?session={}", life.session), None).await;
        match period {
            PERIODS => assert_eq!(status, 409, "{answer}"),
            _ => assert_eq!((status.as_u16(), &answer["period"]), (200, &json!(period + 1)), "{answer}"),
        }
    }
}

async fn poll(owner: Caller, life: Life, over: Arc<AtomicBool>) -> usize {
    let mut answered = 0;
    while !over.load(Ordering::Relaxed) {
        for path in [format!("/action?session={}", life.session), format!("/sessions/{}", life.session)] {
            let acknowledged = life.acknowledged.load(Ordering::SeqCst);
            let (status, answer) = owner.get(&path).await;
            if status == 200 {
                let period = answer["period"].as_u64().expect("a period") as usize;
                assert!(period > acknowledged, "{path}: stale after {acknowledged} periods: {answer}");
                answered += 1;
            }
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    answered
}

/// Every route of sessions, as the description lists them, asked for somebody else's.
fn routes(session: &str, policy: &str) -> Vec<(Method, String, Option<Value>)> {
    let description: Value = serde_json::from_str(include_str!("../../api/openapi.json")).unwrap();
    let mut routes = Vec::new();
    for (path, methods) in description["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            // An import names nothing of anybody: its document is the caller's own. The calendar is no JSON; that it holds
            // nothing of another tenant is tested beside it.
            let is_own = ["/sessions/import", "/reports.ics"].contains(&path.as_str());
            if operation["tags"] != json!(["sessions"]) || is_own {
                continue;
            }
            let body = match path.as_str() {
                "/sessions" => json!({ "policy": policy }),
                "/sessions/{id}" => json!({ "name": "not theirs" }),
                "/observe" => json!({ "session": session, "period": 1, "log_return": 0.5 }),
                "/orders" => {
                    json!({ "session": session, "prices": { "asset": 100.0 }, "units": { "asset": 1.0 }, "cash": 0.0 })
                }
                "/sessions/{id}/corrections" => {
                    json!({ "correction": 1, "period": 1, "log_return": 0.5, "reason": "not theirs" })
                }
                "/sessions/{id}/renewals" => json!({ "renewal": 1, "policy": policy }),
                "/sessions/{id}/letter" | "/sessions/{id}/links" => json!({}),
                _ => json!({ "session": session, "wealth": 1.0 }),
            };
            let query = match path.as_str() {
                "/action" => format!("?session={session}"),
                "/letter" => format!("?link={session}"),
                _ => String::new(),
            };
            let path = path.replace("{id}", session) + &query;
            let method: Method = method.to_uppercase().parse().unwrap();
            routes.push((method.clone(), path, [Method::POST, Method::PATCH].contains(&method).then_some(body)));
        }
    }
    assert!(routes.len() >= 9, "{routes:?}");
    routes
}

async fn intrude(stranger: Caller, lives: Vec<Life>, policy: String, over: Arc<AtomicBool>) -> usize {
    let routes: Vec<_> = lives.iter().flat_map(|life| routes(&life.session, &policy)).collect();
    let mut refused = 0;
    for (method, path, body) in routes.iter().cycle() {
        if over.load(Ordering::Relaxed) {
            break;
        }
        let (status, answer) = stranger.call(method.clone(), path, body.clone()).await;
        let is_empty_list = status == 200 && path == "/sessions" && answer["sessions"] == json!([]);
        let may = is_empty_list || [403, 404].contains(&status.as_u16());
        assert!(may || status.is_server_error(), "{method} {path}: {status} {answer}");
        refused += usize::from(status == 404);
    }
    refused
}

fn finished<T>(what: &str, tasks: Vec<Result<T, tokio::task::JoinError>>) -> Vec<T> {
    tasks.into_iter().map(|task| task.unwrap_or_else(|error| panic!("{what}: {error}"))).collect()
}

async fn callers(app: &App, outside: &Outside) -> [Caller; 3] {
    let mut callers = Vec::new();
    for (tenant, roles) in [("default", "read,operate"), ("south", "read"), ("south", "operate")] {
        let key = issue_key(&outside.ring().await, tenant, roles).await;
        callers.push(Caller { client: Client::new(), url: app.url.clone(), key });
    }
    // The last key made: once it is known, all are.
    until("the keys to count", async || (callers[2].get("/sessions/nobody").await.0 == 403).then_some(())).await;
    callers.try_into().ok().expect("three")
}

async fn no_law_is_stale(mut app: App, outside: Outside) {
    let mut request = specification(PERIODS);
    // The law counts here and not the policy: a quick one.
    request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
    request["design"]["count"] = json!(10);
    app.train(&request).await;
    let mut lives = Vec::new();
    for _ in 0..SESSIONS {
        app.open().await;
        lives.push(Life { session: app.session.clone(), acknowledged: Arc::default() });
    }
    let [owner, reader, operator] = callers(&app, &outside).await;
    let over = Arc::new(AtomicBool::new(false));
    let count = Arc::new(AtomicUsize::new(0));
    let faults = tokio::spawn(outside.fail(over.clone(), count.clone()));
    let strangers: Vec<JoinHandle<usize>> = [reader, operator]
        .into_iter()
        .flat_map(|stranger| [stranger.clone(), stranger])
        .map(|stranger| tokio::spawn(intrude(stranger, lives.clone(), app.policy.clone(), over.clone())))
        .collect();
    let poll = |life: &Life| tokio::spawn(poll(owner.clone(), life.clone(), over.clone()));
    let pollers: Vec<JoinHandle<usize>> = lives.iter().flat_map(|life| [life; POLLERS]).map(poll).collect();
    let owners: Vec<_> = lives.iter().map(|life| tokio::spawn(live(owner.clone(), life.clone()))).collect();
    let lived = join_all(owners).await;
    // However quickly they lived, what they left is asked for through a few faults.
    let enough = async || (count.load(Ordering::Relaxed) > FAULTS).then_some(());
    until("a few faults", enough).await;
    over.store(true, Ordering::Relaxed);
    finished("an owner", lived);
    let answered: usize = finished("a poller", join_all(pollers).await).into_iter().sum();
    let refused: usize = finished("a stranger", join_all(strangers).await).into_iter().sum();
    faults.await.unwrap();
    let faults = count.load(Ordering::Relaxed);
    println!("{SESSIONS} sessions of {PERIODS} periods: {answered} polls, {refused} refusals, {faults} faults");
    assert!(answered > PERIODS && refused > PERIODS && faults > FAULTS, "nothing was tried");
}

fn unlimited(config: &mut ballast::service::process::config::Config) {
    config.limits = Limits::new([0; 3], 64);
}

#[tokio::test(flavor = "multi_thread")]
async fn no_law_is_stale_over_a_folder() {
    let app = App::configured(unlimited).await;
    let file = app.folder().join("ballast.sqlite");
    no_law_is_stale(app, Outside::File(file)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_law_is_stale_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    let location = StoreLocation::Postgres(url.parse().unwrap());
    let app = App::configured(|config| {
        unlimited(config);
        config.store = location;
    })
    .await;
    no_law_is_stale(app, Outside::Server(url)).await;
}
