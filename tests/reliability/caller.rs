//! A client that expects faults: an answer, or none yet.

use std::time::Duration;

use crate::support::patience::within;
use reqwest::{Client, Method};
use serde_json::{Value, json};

/// A server that is stopped or has lost its disk may answer nothing at all.
const PATIENCE: Duration = Duration::from_secs(5);

#[derive(Clone)]
pub struct Caller {
    client: Client,
    /// Replicas, asked in turn.
    urls: Vec<String>,
    /// Shown with every call.
    key: Option<String>,
}

/// Status and body of an answer.
pub type Answer = (u16, Value);

impl Caller {
    pub fn new(urls: &[&str]) -> Caller {
        Caller { client: client(), urls: urls.iter().map(|&url| url.to_owned()).collect(), key: None }
    }

    pub fn with_key(url: &str, key: &str) -> Caller {
        Caller { key: Some(key.to_owned()), ..Caller::new(&[url]) }
    }

    /// Another like it, over connections of its own.
    pub fn another(&self) -> Caller {
        Caller { client: client(), ..self.clone() }
    }

    /// From now on the next replica is asked first.
    pub fn turn(&mut self) {
        self.urls.rotate_left(1);
    }

    pub async fn get(&self, path: &str) -> Option<Answer> {
        self.call(Method::GET, path, None, None).await
    }

    pub async fn post(&self, path: &str, body: &Value) -> Option<Answer> {
        self.call(Method::POST, path, Some(body), None).await
    }

    pub async fn delete(&self, path: &str) -> Option<Answer> {
        self.call(Method::DELETE, path, None, None).await
    }

    /// Queues a training under an idempotency key.
    pub async fn train(&self, key: &str, specification: &Value) -> Option<Answer> {
        self.call(Method::POST, "/train", Some(specification), Some(key)).await
    }

    /// `None` where the connection broke.
    async fn call(&self, method: Method, path: &str, body: Option<&Value>, key: Option<&str>) -> Option<Answer> {
        let mut request = self.client.request(method, format!("{}{path}", self.urls[0]));
        if let Some(body) = body {
            request = request.json(body);
        }
        if let Some(key) = key {
            request = request.header("idempotency-key", key);
        }
        if let Some(key) = &self.key {
            request = request.bearer_auth(key);
        }
        let answer = request.send().await.ok()?;
        let status = answer.status().as_u16();
        let text = answer.text().await.ok()?;
        Some((status, serde_json::from_str(&text).unwrap_or(Value::String(text))))
    }

    /// A question as it goes over the wire.
    pub fn request(&self, method: &str, path: &str) -> String {
        self.request_with(method, path, "")
    }

    /// A question as it goes over the wire, with a body of JSON unless that is empty.
    pub fn request_with(&self, method: &str, path: &str, body: &str) -> String {
        let key = self.key.as_deref().unwrap_or_default();
        let head = format!("{method} {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {key}\r\n");
        if body.is_empty() {
            return head + "\r\n";
        }
        format!("{head}content-type: application/json\r\ncontent-length: {}\r\n\r\n{body}", body.len())
    }

    /// Every job, newest first.
    pub async fn jobs(&self) -> Option<Vec<Value>> {
        let (mut jobs, mut after) = (Vec::new(), String::new());
        loop {
            let (status, page) = self.get(&format!("/jobs?limit=1000{after}")).await?;
            if status != 200 {
                return None;
            }
            jobs.extend(page["jobs"].as_array()?.iter().cloned());
            match page["next"].as_i64() {
                Some(next) => after = format!("&after={next}"),
                None => return Some(jobs),
            }
        }
    }

    /// Opens a session; its name.
    pub async fn open(&self, policy: &str) -> Option<String> {
        let (status, session) = self.post("/sessions", &json!({ "policy": policy })).await?;
        (status == 201).then(|| session["session"].as_str().unwrap_or_default().to_owned())
    }
}

fn client() -> Client {
    Client::builder().timeout(within(PATIENCE)).build().unwrap()
}
