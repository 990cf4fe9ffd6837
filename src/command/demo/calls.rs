//! What the demo asks of the service, and what it reads in the answers.

use std::time::Duration;

use serde::Deserialize;
use serde_json::{Value, json};

use super::DemoError;
use super::past::{ALPHA, INITIAL_WEALTH, Past, RISK_AVERSION};
use super::progress::{Job, ProgressView};
use crate::command::api_client::ApiClient;

/// Pause before an event stream that ended early is opened again.
const BEFORE_REOPENING: Duration = Duration::from_millis(250);

/// What the demo reads of `GET /action`.
#[derive(Debug, Clone, Deserialize)]
pub struct Advice {
    pub period: usize,
    pub allocation: f64,
    pub radius: f64,
    pub sample_size: usize,
    pub certainty_equivalent: f64,
    pub floor: f64,
    pub worst_case: Option<WorstCase>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct WorstCase {
    pub sentence: String,
    pub transport: Vec<Move>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct Move {
    pub atom: f64,
    pub moved_to: f64,
    pub mass: f64,
}

impl Move {
    /// Its share of the radius.
    pub fn cost(&self) -> f64 {
        self.mass * (self.moved_to - self.atom).abs()
    }
}

fn read<T: for<'a> Deserialize<'a>>(call: &'static str, value: Value) -> Result<T, DemoError> {
    serde_json::from_value(value).map_err(|source| DemoError::Shape { call, source })
}

/// Queues the training, follows its events to the end, and returns the policy's name.
pub async fn train(api: &ApiClient, past: &Past, horizon: usize, count: usize) -> Result<String, DemoError> {
    let request = json!({
        "problem": {
            "framework": "adaptive",
            "horizon": horizon,
            "rate_per_step": past.rate,
            "initial_wealth": INITIAL_WEALTH,
            "utility": { "kind": "power", "risk_aversion": RISK_AVERSION },
            "radius": { "rule": "bridge", "alpha": ALPHA },
            "history": past.log_returns,
        },
        "design": { "count": count },
    });
    let mut job: Job = read("POST /train", api.post("/train", &request).await?)?;
    let path = format!("/jobs/{}", job.job);
    let mut view = ProgressView::new(horizon);
    while !job.is_over() {
        // A stream that ends early is opened again; the job itself says whether there is more to come.
        let mut events = api.events(&format!("{path}/events")).await?;
        while let Some(event) = events.next().await? {
            job = read("GET /jobs/{id}/events", event)?;
            if let Some(progress) = &job.progress {
                view.show(progress);
            }
        }
        job = read("GET /jobs/{id}", api.get(&path).await?)?;
        if !job.is_over() {
            tokio::time::sleep(BEFORE_REOPENING).await;
        }
    }
    view.finish();
    let reason = job.error.map_or(String::from("no reason given"), |error| error.to_string());
    job.policy.ok_or(DemoError::Training { state: job.state, reason })
}

pub async fn open_session(api: &ApiClient, policy: &str) -> Result<String, DemoError> {
    #[derive(Deserialize)]
    struct Session {
        session: String,
    }
    let session: Session = read("POST /sessions", api.post("/sessions", &json!({ "policy": policy })).await?)?;
    Ok(session.session)
}

pub async fn advice(api: &ApiClient, session: &str, explained: bool) -> Result<Advice, DemoError> {
    let explain = if explained { "&explain=worst_case" } else { "" };
    read("GET /action", api.get(&format!("/action?session={session}{explain}")).await?)
}

/// Reports the return of a period; the wealth it led to.
pub async fn observe(api: &ApiClient, session: &str, period: usize, simple_return: f64) -> Result<f64, DemoError> {
    #[derive(Deserialize)]
    struct Observed {
        wealth: f64,
    }
    let report = json!({ "session": session, "period": period, "simple_return": simple_return });
    let observed: Observed = read("POST /observe", api.post("/observe", &report).await?)?;
    Ok(observed.wealth)
}
