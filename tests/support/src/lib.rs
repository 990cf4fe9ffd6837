//! A real server on a free port, and a client whose calls read like a story.

pub mod certificates;
pub mod patience;
pub mod place;
pub mod policies;
pub mod postgres;
pub mod process;
pub mod random;
pub mod values;

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use ballast::http::{self, RunningServer};
use ballast::service::callers::keys;
use ballast::service::process::clock::Clock;
use ballast::service::process::config::{Config, StoreLocation, WebhookSettings};
use ballast::service::process::shutdown::Shutdown;
use ballast::store::{Append, EntryRow, KeyRing, Store, Tenant};
use reqwest::header::{AUTHORIZATION, HeaderMap};
use reqwest::{Client, Method, Response, StatusCode};
use serde_json::{Value, json};
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use tempfile::TempDir;

pub struct App {
    pub client: Client,
    pub url: String,
    pub session: String,
    pub policy: String,
    folder: TempDir,
    /// The store of the service that runs in this process.
    store: Option<StoreLocation>,
    webhooks: WebhookSettings,
    running: Option<RunningServer>,
}

/// Runs each test over a folder, and over a database that replicas share.
#[macro_export]
macro_rules! over_either_store {
    ($($story:ident),* $(,)?) => {
        mod over_a_folder {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $story() {
                super::$story($crate::App::start().await).await;
            })*
        }
        mod over_a_database {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $story() {
                if let Some(app) = $crate::App::over_a_database().await {
                    super::$story(app).await;
                }
            })*
        }
    };
}

/// Returns labels at all their limits, in letters of four bytes.
pub fn labels() -> Value {
    let letters = |count| "\u{10348}".repeat(count);
    let tags: Vec<String> = (0..20).map(|tag| format!("{}{tag:02}", letters(48))).collect();
    json!({ "name": letters(100), "notes": letters(2000), "tags": tags })
}

/// Returns the object `body` with such labels.
pub fn labelled(mut body: Value) -> Value {
    body.as_object_mut().expect("an object").extend(labels().as_object().expect("an object").clone());
    body
}

/// Returns of stocks, bonds and gold in ten periods.
pub const ROWS: [[f64; 3]; 10] = [
    [0.0231, 0.004, -0.011],
    [-0.0442, 0.009, 0.031],
    [0.031, -0.003, 0.002],
    [0.043, 0.001, -0.024],
    [-0.012, 0.006, 0.017],
    [0.018, 0.002, 0.009],
    [0.055, -0.004, -0.013],
    [-0.027, 0.008, 0.021],
    [0.026, 0.003, -0.006],
    [0.012, 0.005, 0.014],
];

/// Returns a small training for these assets.
pub fn several_assets(horizon: usize) -> Value {
    json!({
        "problem": {
            "assets": ["stocks", "bonds", "gold"],
            "horizon": horizon,
            "rate_per_step": 0.001,
            "radius": { "rule": "bridge", "alpha": 0.1, "paths": 200, "scale": 0.2 },
            "support": { "rule": "none" },
            "history": ROWS
        },
        "design": { "count": 20 }
    })
}

/// Returns a small training: `horizon` steps, 20 design points.
pub fn specification(horizon: usize) -> Value {
    json!({
        "problem": {
            "horizon": horizon,
            "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 },
            "history": [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002],
            "radius": { "rule": "bridge", "alpha": 0.1, "paths": 200, "scale": 1.0 },
            "support": { "rule": "none" }
        },
        "design": { "count": 20 }
    })
}

/// Trains the policy of a specification in this process and returns its portable document.
pub fn trained(specification: &Value) -> Vec<u8> {
    policies::train(specification.clone()).to_json().expect("a document")
}

async fn connection(folder: &Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(folder.join("ballast.sqlite"));
    SqliteConnection::connect_with(&options).await.expect("the database")
}

/// Runs a statement on the database without the service's knowledge.
pub async fn execute(folder: &Path, statement: &str) {
    let mut connection = connection(folder).await;
    sqlx::query(sqlx::AssertSqlSafe(statement.to_owned())).execute(&mut connection).await.expect(statement);
    connection.close().await.expect("closed");
}

/// Returns how often the one job of the folder was claimed.
pub async fn attempts(folder: &Path) -> i64 {
    let mut connection = connection(folder).await;
    sqlx::query_scalar("SELECT attempt FROM jobs").fetch_one(&mut connection).await.expect("one job")
}

/// Returns the bytes of each entry of the folder's sessions, in the order they were recorded.
pub async fn entry_bytes(folder: &Path) -> Vec<i64> {
    let mut connection = connection(folder).await;
    let bytes =
        "SELECT octet_length(content_json) + octet_length(answer_json) + octet_length(numbers) + octet_length(seal)
        + octet_length(access_key) + 2 * octet_length(session) FROM entries ORDER BY rowid";
    sqlx::query_scalar(bytes).fetch_all(&mut connection).await.expect("entries")
}

/// A lock that keeps the service from writing until it is released.
pub struct Lock(SqliteConnection);

/// Locks the database of the folder.
pub async fn lock_out(folder: &Path) -> Lock {
    let mut connection = connection(folder).await;
    sqlx::query("BEGIN IMMEDIATE").execute(&mut connection).await.expect("a lock");
    Lock(connection)
}

impl Lock {
    pub async fn give_up(mut self) {
        sqlx::query("ROLLBACK").execute(&mut self.0).await.expect("the lock given up");
        self.0.close().await.expect("closed");
    }
}

/// Creates a key and returns its text.
pub async fn issue_key(ring: &KeyRing, tenant: &str, roles: &str) -> String {
    let (tenant, roles) = (tenant.parse().expect("a tenant"), roles.parse().expect("roles"));
    let (_, secret) = keys::issue(ring, tenant, roles, None, &Clock::system()).await.expect("a key");
    ring.close().await;
    secret.reveal().to_owned()
}

fn config(folder: &Path) -> Config {
    Config { listen: ([127, 0, 0, 1], 0).into(), body_limit_bytes: 1 << 20, ..Config::new(folder) }
}

async fn start(config: Config) -> RunningServer {
    http::serve(config, Shutdown::new()).await.expect("the service starts")
}

impl App {
    pub async fn start() -> App {
        App::configured(|_| {}).await
    }

    /// Starts with a configuration changed by `change`; a restart keeps its store and how it sends webhooks.
    pub async fn configured(change: impl FnOnce(&mut Config)) -> App {
        let folder = tempfile::tempdir().expect("a folder");
        let mut config = config(folder.path());
        change(&mut config);
        let (store, webhooks) = (Some(config.store.clone()), config.webhooks.clone());
        let running = start(config).await;
        let url = format!("http://{}", running.address);
        App { running: Some(running), store, webhooks, ..App::at(url, folder) }
    }

    /// Starts over a new database; returns `None` if there is no PostgreSQL.
    pub async fn over_a_database() -> Option<App> {
        let store = StoreLocation::Postgres(postgres::database().await?.parse().expect("an address"));
        Some(App::configured(|config| config.store = store).await)
    }

    /// Returns a client of a service that another process runs over `folder`.
    pub fn at(url: String, folder: TempDir) -> App {
        let (session, policy) = (String::new(), String::new());
        let webhooks = WebhookSettings::default();
        App { client: Client::new(), url, session, policy, folder, store: None, webhooks, running: None }
    }

    /// Sends `key` with every request from now on, or no key if it is empty.
    pub fn hold(&mut self, key: &str) {
        let shown = (!key.is_empty()).then(|| (AUTHORIZATION, format!("Bearer {key}").parse().expect("a header")));
        self.client = Client::builder().default_headers(HeaderMap::from_iter(shown)).build().expect("a client");
    }

    /// Creates a key while the service runs over this folder or this database.
    pub async fn key(&self, tenant: &str, roles: &str) -> String {
        let ring = match &self.store {
            Some(StoreLocation::Postgres(url)) => KeyRing::connect(url).await,
            _ => KeyRing::open(self.folder()).await,
        };
        issue_key(&ring.expect("the keys"), tenant, roles).await
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Stops the service as SIGTERM does and starts another over the same store.
    pub async fn restart(&mut self) {
        self.stop().await;
        self.start_again().await;
    }

    /// Restarts like [`Self::restart`], and runs a statement on the database of the folder in between.
    pub async fn restart_after(&mut self, statement: &'static str) {
        self.stop().await;
        execute(self.folder.path(), statement).await;
        self.start_again().await;
    }

    /// Restarts like [`Self::restart`], and in between replaces the last entry of a session by a valid one with another
    /// answer. `database` is the address of the store if it is not a folder.
    pub async fn retell(&mut self, session: &str, database: Option<&str>, change: impl Fn(&str) -> String) {
        self.stop().await;
        let store = match database {
            None => Store::open(self.folder()).await,
            Some(url) => Store::connect(&url.parse().expect("an address")).await,
        };
        let store = store.expect("the store");
        let facts = store.session_facts(&Tenant::default(), session).await.expect("read").expect("a session");
        let entry = facts.entries.into_iter().last().expect("an entry");
        let remove = format!("DELETE FROM entries WHERE session = '{session}' AND entry = {}", entry.entry);
        match database {
            None => execute(self.folder(), &remove).await,
            Some(url) => assert_eq!(postgres::execute(url, &remove).await, 1),
        }
        let answer_json = change(&entry.answer_json);
        assert_ne!(answer_json, entry.answer_json, "the answer is another");
        assert_eq!(store.append(EntryRow { answer_json, ..entry }).await.expect("stored"), Append::Appended);
        store.close().await;
        self.start_again().await;
    }

    /// Runs `change` on the store between a stop and a start of the service.
    pub async fn between(&mut self, change: impl AsyncFnOnce(&Store)) {
        self.stop().await;
        let store = match self.store.as_ref().expect("a store") {
            StoreLocation::Folder(folder) => Store::open(folder).await,
            StoreLocation::Postgres(url) => Store::connect(url).await,
        };
        let store = store.expect("the store");
        change(&store).await;
        store.close().await;
        self.start_again().await;
    }

    /// Stops the service and starts one over a subfolder of this folder.
    pub async fn move_to(&mut self, folder: &str) {
        self.stop().await;
        self.store = Some(StoreLocation::Folder(self.folder.path().join(folder)));
        self.start_again().await;
    }

    /// Stops the service until another starts.
    pub async fn halt(&mut self) {
        self.stop().await;
    }

    /// Starts a service over another store, after a halt.
    pub async fn start_over(&mut self, store: StoreLocation) {
        self.store = Some(store);
        self.start_again().await;
    }

    async fn stop(&mut self) {
        self.client = Client::new();
        self.running.take().expect("running").stop().await.expect("the store holds");
    }

    async fn start_again(&mut self) {
        let mut config = config(self.folder.path());
        config.store = self.store.clone().expect("a store");
        config.webhooks = self.webhooks.clone();
        let running = start(config).await;
        self.url = format!("http://{}", running.address);
        self.running = Some(running);
    }

    pub async fn send(&self, method: Method, path: &str, body: Option<&Value>) -> (StatusCode, Value) {
        let request = self.client.request(method.clone(), format!("{}{path}", self.url));
        let request = match body {
            Some(body) => request.json(body),
            None => request,
        };
        let (status, answer) = read(request.send().await.expect("an answer")).await;
        assert_described(&method, path, status);
        (status, answer)
    }

    pub async fn get(&self, path: &str) -> (StatusCode, Value) {
        self.send(Method::GET, path, None).await
    }

    pub async fn post(&self, path: &str, body: &Value) -> (StatusCode, Value) {
        self.send(Method::POST, path, Some(body)).await
    }

    pub async fn delete(&self, path: &str) -> StatusCode {
        self.send(Method::DELETE, path, None).await.0
    }

    /// Waits until keys created beside the service are in force, and sends this one from then on. Of several keys, the one
    /// created last must be entered first: the others are known by then.
    pub async fn enter(&mut self, key: &str) {
        for (shown, is_turned_away) in [("", true), (key, false)] {
            self.hold(shown);
            let counts = async || ((self.get("/jobs").await.0 == 401) == is_turned_away).then_some(());
            patience::until("the keys to count", counts).await;
        }
    }

    pub async fn cancel(&self, job: &str) -> StatusCode {
        self.send(Method::POST, &format!("/jobs/{job}/cancel"), None).await.0
    }

    /// Queues a training and returns its job.
    pub async fn queue(&self, specification: &Value) -> String {
        let (status, job) = self.post("/train", specification).await;
        assert_eq!(status, 202, "{job}");
        job["job"].as_str().expect("a job").to_owned()
    }

    /// Waits until the job satisfies `reached`. The deadline is long because the jobs of other tests share the
    /// processors.
    pub async fn until(&self, job: &str, reached: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + 3 * patience::patience();
        let mut steps_done = 0;
        loop {
            let (_, now) = self.get(&format!("/jobs/{job}")).await;
            let steps = now["progress"]["steps_done"].as_u64().expect("a count");
            assert!(steps >= steps_done, "from {steps_done} steps done back to {now}");
            steps_done = steps;
            if reached(&now) {
                return now;
            }
            assert!(Instant::now() < deadline, "still {now}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// Trains a policy and remembers it.
    pub async fn train(&mut self, specification: &Value) {
        let job = self.queue(specification).await;
        let done = self.until(&job, |job| job["finished_ms"].is_i64()).await;
        assert_eq!(done["state"], "succeeded", "{done}");
        self.policy = done["policy"].as_str().expect("a policy").to_owned();
    }

    /// Opens a session of the policy and remembers it.
    pub async fn open(&mut self) {
        self.open_with(json!({})).await;
    }

    /// Opens a session of the policy with `history` or `wealth` of its own.
    pub async fn open_with(&mut self, mut request: Value) {
        request["policy"] = json!(self.policy);
        let (status, session) = self.post("/sessions", &request).await;
        assert_eq!(status, 201, "{session}");
        self.session = session["session"].as_str().expect("a session").to_owned();
    }

    /// Observes a return and confirms it, even if it is unusual for the record.
    pub async fn observe(&self, period: usize, log_return: f64) -> (StatusCode, Value) {
        self.report(period, json!({ "log_return": log_return, "confirm": true })).await
    }

    /// Observes the period with the fields of `report`.
    pub async fn report(&self, period: usize, mut report: Value) -> (StatusCode, Value) {
        (report["session"], report["period"]) = (json!(self.session), json!(period));
        self.post("/observe", &report).await
    }

    /// Returns the exported policy, as bytes.
    pub async fn export(&self) -> Vec<u8> {
        let answer = self.client.get(format!("{}/policies/{}/export", self.url, self.policy)).send().await;
        answer.expect("an answer").bytes().await.expect("a document").to_vec()
    }

    pub async fn action(&self) -> (StatusCode, Value) {
        self.get(&format!("/action?session={}", self.session)).await
    }
}

/// Reads an answer and checks that every error is a problem document; a client's error names field, value and rule.
pub async fn read(response: Response) -> (StatusCode, Value) {
    let status = response.status();
    let media = response.headers().get("content-type").map(|media| media.to_str().expect("text").to_owned());
    let text = response.text().await.expect("a body");
    let answer = serde_json::from_str(&text).unwrap_or(Value::String(text));
    if status.is_client_error() || status.is_server_error() {
        assert_eq!(media.as_deref(), Some("application/problem+json"), "{status}");
    }
    if status.is_client_error() {
        assert!(answer["field"].is_string() && answer["rule"].is_string(), "{answer}");
        assert!(answer.get("value").is_some(), "{answer}");
    }
    (status, answer)
}

/// Asserts that `api/openapi.json` lists the status for the operation.
fn assert_described(method: &Method, path: &str, status: StatusCode) {
    static DESCRIPTION: LazyLock<Value> =
        LazyLock::new(|| serde_json::from_str(include_str!("../../../api/openapi.json")).expect("JSON"));
    let parts = |path: &str| path.split('?').next().unwrap_or("").split('/').map(str::to_owned).collect::<Vec<_>>();
    let requested = parts(path);
    let fits = |template: &str| {
        let template = parts(template);
        template.len() == requested.len() && template.iter().zip(&requested).all(|(t, a)| t == a || t.starts_with('{'))
    };
    let paths = DESCRIPTION["paths"].as_object().expect("paths");
    let mut operations = paths.iter().filter(|(template, _)| fits(template)).map(|(_, operations)| operations);
    let operation = operations.find_map(|operations| operations.get(method.as_str().to_lowercase()));
    if let Some(operation) = operation {
        assert!(operation["responses"].get(status.as_str()).is_some(), "{method} {path} does not describe {status}");
    }
}
