//! A real server on a free port, and a client that tells stories.
#![allow(dead_code)]

use std::path::Path;
use std::time::{Duration, Instant};

use ballast::http::{self, Running};
use ballast::service::config::Config;
use ballast::service::shutdown::Shutdown;
use reqwest::{Client, Method, Response, StatusCode};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Nothing that is waited for takes longer.
const PATIENCE: Duration = Duration::from_secs(60);

pub struct App {
    pub client: Client,
    pub url: String,
    pub session: String,
    pub policy: String,
    folder: TempDir,
    running: Option<Running>,
}

/// A small training: `horizon` steps, 20 design points.
pub fn specification(horizon: usize) -> Value {
    json!({
        "problem": {
            "horizon": horizon,
            "history": [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002],
            "radius": { "rule": "bridge", "alpha": 0.1, "paths": 200, "scale": 1.0 }
        },
        "design": { "count": 20 }
    })
}

async fn start(folder: &Path) -> Running {
    let config = Config { listen: ([127, 0, 0, 1], 0).into(), body_limit_bytes: 1 << 20, ..Config::new(folder) };
    http::serve(config, Shutdown::new()).await.expect("the service starts")
}

impl App {
    pub async fn start() -> App {
        let folder = tempfile::tempdir().expect("a folder");
        let running = start(folder.path()).await;
        let url = format!("http://{}", running.address);
        App {
            client: Client::new(),
            url,
            session: String::new(),
            policy: String::new(),
            folder,
            running: Some(running),
        }
    }

    /// Stops the service as SIGTERM does and starts another on the same folder.
    pub async fn restart(&mut self) {
        self.client = Client::new();
        self.running.take().expect("running").stop().await;
        let running = start(self.folder.path()).await;
        self.url = format!("http://{}", running.address);
        self.running = Some(running);
    }

    pub async fn send(&self, method: Method, path: &str, body: Option<&Value>) -> (StatusCode, Value) {
        let request = self.client.request(method, format!("{}{path}", self.url));
        let request = match body {
            Some(body) => request.json(body),
            None => request,
        };
        read(request.send().await.expect("an answer")).await
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

    /// Queues a training; its job.
    pub async fn queue(&self, specification: &Value) -> String {
        let (status, job) = self.post("/train", specification).await;
        assert_eq!(status, 202, "{job}");
        job["job"].as_str().expect("a job").to_owned()
    }

    /// Waits until the job satisfies `reached`.
    pub async fn until(&self, job: &str, reached: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let (_, now) = self.get(&format!("/jobs/{job}")).await;
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
        let (status, session) = self.post("/sessions", &json!({ "policy": self.policy })).await;
        assert_eq!(status, 201, "{session}");
        self.session = session["session"].as_str().expect("a session").to_owned();
    }

    pub async fn observe(&self, period: usize, log_return: f64) -> (StatusCode, Value) {
        self.post("/observe", &json!({ "session": self.session, "period": period, "log_return": log_return })).await
    }

    pub async fn action(&self) -> (StatusCode, Value) {
        self.get(&format!("/action?session={}", self.session)).await
    }
}

pub async fn read(response: Response) -> (StatusCode, Value) {
    let status = response.status();
    let media = response.headers().get("content-type").map(|media| media.to_str().expect("text").to_owned());
    if status.is_client_error() || status.is_server_error() {
        assert_eq!(media.as_deref(), Some("application/problem+json"), "{status}");
    }
    let text = response.text().await.expect("a body");
    (status, serde_json::from_str(&text).unwrap_or(Value::String(text)))
}
