//! The demo's calls to the service, and the parts of the answers it reads.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::DemoError;
use super::past::{ALPHA, INITIAL_WEALTH, RISK_AVERSION};
use super::progress::{DemoJob, ProgressView};
use ballast::http::api_client::ApiClient;

/// Pause before an event stream that ended early is opened again.
const BEFORE_REOPENING: Duration = Duration::from_millis(250);

/// Fields that the demo reads from `GET /action`.
#[derive(Debug, Clone, Deserialize)]
pub struct DemoAdvice {
    pub period: usize,
    pub allocation: f64,
    pub radius: f64,
    pub sample_size: usize,
    pub certainty_equivalent: f64,
    pub floor: f64,
    pub worst_case: Option<DemoWorstCase>,
}

/// Fields for several assets, by name.
#[derive(Debug, Clone, Deserialize)]
pub struct DemoAssetsAdvice {
    pub period: usize,
    pub allocation: BTreeMap<String, f64>,
    pub trade: BTreeMap<String, f64>,
    pub total: f64,
    pub radius: f64,
    pub certainty_equivalent: f64,
    pub floor: f64,
    pub one_step: DemoOneStep,
    pub worst_case: Option<DemoWorstCase>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct DemoOneStep {
    pub worst_means: BTreeMap<String, DemoWorstMean>,
}

/// Mean of an asset's log-return, estimated and under the worst law.
#[derive(Debug, Clone, Deserialize)]
pub struct DemoWorstMean {
    pub seen: f64,
    pub worst: f64,
}

#[derive(Debug, Clone, Deserialize)]
pub struct DemoWorstCase {
    pub sentence: String,
    pub transport: Vec<DemoMove>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct DemoMove {
    pub atom: f64,
    pub moved_to: f64,
    pub mass: f64,
}

impl DemoMove {
    /// Returns the move's share of the radius.
    pub fn cost(&self) -> f64 {
        self.mass * (self.moved_to - self.atom).abs()
    }
}

fn read<T: for<'a> Deserialize<'a>>(call: &'static str, value: Value) -> Result<T, DemoError> {
    serde_json::from_value(value).map_err(|source| DemoError::Shape { call, source })
}

/// Queues the training of the demo's investor for the returns in `record`, follows its events to the end, and returns
/// the policy's name.
pub async fn train(api: &ApiClient, record: Value, horizon: usize, count: usize) -> Result<String, DemoError> {
    let mut problem = json!({
        "horizon": horizon,
        "initial_wealth": INITIAL_WEALTH,
        "utility": { "kind": "power", "risk_aversion": RISK_AVERSION },
        "radius": { "rule": "bridge", "alpha": ALPHA },
        "caution": "paper",
        "support": { "rule": "none" },
    });
    if let (Some(problem), Value::Object(record)) = (problem.as_object_mut(), record) {
        problem.extend(record);
    }
    let request = json!({ "problem": problem, "design": { "count": count } });
    let mut job: DemoJob = read("POST /train", api.post("/train", &request).await?)?;
    let path = format!("/jobs/{}", job.job);
    let mut view = ProgressView::new(horizon);
    while !job.is_over() {
        // A stream that ends early is opened again; the job itself shows whether there is more to come.
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
    struct DemoSession {
        session: String,
    }
    let session: DemoSession = read("POST /sessions", api.post("/sessions", &json!({ "policy": policy })).await?)?;
    Ok(session.session)
}

pub async fn advice<T: DeserializeOwned>(api: &ApiClient, session: &str, explained: bool) -> Result<T, DemoError> {
    let explain = if explained { "&explain=worst_case" } else { "" };
    read("GET /action", api.get(&format!("/action?session={session}{explain}")).await?)
}

/// Reports the returns of a period, `returns` by the names that they have in the call, and returns the recorded wealth
/// after it.
pub async fn observe(
    api: &ApiClient,
    session: &str,
    period: usize,
    (name, returns): (&str, Value),
) -> Result<f64, DemoError> {
    #[derive(Deserialize)]
    struct DemoObserved {
        wealth: f64,
    }
    let report = json!({ "session": session, "period": period, name: returns, "confirm": true });
    let observed: DemoObserved = read("POST /observe", api.post("/observe", &report).await?)?;
    Ok(observed.wealth)
}
