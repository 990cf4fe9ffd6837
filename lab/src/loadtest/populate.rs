//! The prerequisites of a scenario: a policy, and sessions that follow it.

use std::error::Error;
use std::path::Path;

use ballast::control::policy::content_hash;
use ballast::control::pool::TrainingPool;
use ballast::control::progress::Watch;
use ballast::control::request::specification::{InitialLaws, Specification};
use ballast::control::training::Training;
use ballast::service::error::ServiceError;
use ballast::service::sessions::plan::SessionPlan;
use ballast::store::{CreateSession, InitialAccount, Relabel, SessionRow, Store, Tenant};
use futures_util::{StreamExt, stream};
use serde_json::Value;

use super::connection::{LoadConnection, get, post};
use super::load::bodies;
use super::server::Server;
use super::{LoadTest, tell};
use crate::paper;

/// Number of returns that sessions cycle through: enough that no two sessions see the same.
const RETURNS: usize = 4093;
/// Number of returns before a session starts, as in the paper.
const HISTORY: usize = 20;
/// Number of sessions that wait for the store's commits at a time.
const IN_FLIGHT: usize = 1024;

/// A policy, and the returns of its sessions.
pub struct LoadFixture {
    pub policy: String,
    pub horizon: usize,
    specification: Specification,
    returns: Vec<f64>,
}

/// Returns the paper's problem with `horizon` steps and `count` design points per step.
fn specification(horizon: usize, count: usize) -> Specification {
    paper::specification(HISTORY, horizon, count, InitialLaws::Given)
}

impl LoadFixture {
    /// Trains the policy here, on every core, and imports it into the service.
    pub async fn train(server: &Server, arguments: &LoadTest) -> Result<Self, Box<dyn Error>> {
        let LoadTest { horizon, count, .. } = *arguments;
        tell(&format!("training {horizon} steps of {count} design points"));
        let training = Training::new(&specification(horizon, count))?;
        let watch = Watch::unwatched();
        let pool = TrainingPool::new(std::thread::available_parallelism().map_or(1, usize::from))?;
        let trained = pool.install(|| training.run(&watch))?;
        let import = post("/policies/import", &String::from_utf8(trained.to_json()?)?);
        let imported = LoadConnection::open(server.addresses[0]).await?.exchange(&import).await?.to_vec();
        let policy = text(&serde_json::from_slice(&imported)?, "policy")?;
        let specification = trained.specification().clone();
        Ok(LoadFixture { policy, horizon, specification, returns: paper::history(RETURNS, 2) })
    }

    /// Opens `count` sessions over HTTP.
    pub async fn open(&self, server: &Server, clients: usize, count: u32) -> Result<Vec<String>, Box<dyn Error>> {
        tell(&format!("opening {count} sessions"));
        let request = post("/sessions", &format!(r#"{{"policy":"{}"}}"#, self.policy));
        let opened = bodies(server.addresses[0], clients, &vec![request; count as usize]).await?;
        opened.iter().map(|body| text(&serde_json::from_slice(body)?, "session")).collect()
    }

    /// Returns the report of a session's `period`; `index` is the session's index in the scenario.
    fn report(&self, session: &str, index: usize, period: usize) -> String {
        let log_return = self.returns[(index + 61 * period) % RETURNS];
        format!(r#"{{"session":"{session}","period":{period},"log_return":{log_return},"confirm":true}}"#)
    }

    /// Returns the call that reports `period` of these sessions: a single one as an object, several as a list.
    pub fn observation(&self, sessions: &[(usize, &String)], period: usize) -> Vec<u8> {
        let reports: Vec<String> =
            sessions.iter().map(|&(index, session)| self.report(session, index, period)).collect();
        match reports.as_slice() {
            [report] => post("/observe", report),
            reports => post("/observe", &format!("[{}]", reports.join(","))),
        }
    }

    /// Writes `count` sessions directly into the store of a stopped service, many per commit.
    pub async fn fill(&self, folder: &Path, store: Option<&str>, count: u32) -> Result<Vec<String>, Box<dyn Error>> {
        tell(&format!("writing {count} sessions into the store"));
        let store = match store {
            Some(url) => Store::connect(&url.parse()?).await?,
            None => Store::open(folder).await?,
        };
        let creating = stream::iter(0..count).map(|index| {
            let (store, new) = (store.clone(), self.session(index));
            async move {
                let new = new?;
                let outcome = store.create_session(new.clone(), Relabel::default(), None).await?;
                Ok::<_, Box<dyn Error>>((outcome, new.session))
            }
        });
        let created: Vec<_> = creating.buffered(IN_FLIGHT).collect().await;
        store.close().await;
        let session = |created: Result<_, Box<dyn Error>>| match created? {
            (CreateSession::Created, session) => Ok(session),
            (refused, session) => Err(format!("the store answered {refused:?} to {session}").into()),
        };
        created.into_iter().map(session).collect()
    }

    fn session(&self, index: u32) -> Result<SessionRow, ServiceError> {
        let problem = &self.specification.problem;
        Ok(SessionRow {
            tenant: Tenant::default(),
            // Spread like the service's own names, which are random.
            session: format!("session_{}", &content_hash(&index.to_le_bytes())[..32]),
            policy: self.policy.clone(),
            account: Some(InitialAccount { wealth: problem.initial_wealth, holding: 0.0 }),
            initial_history: problem.history.clone(),
            horizon: self.horizon,
            plan_json: SessionPlan::once(&self.specification).json()?,
            due: None,
            assets: 0,
            created_ms: 0,
        })
    }
}

/// Starts a training of 1,000 design points and returns its job.
pub async fn long_training(server: &Server) -> Result<String, Box<dyn Error>> {
    let mut specification = specification(60, 1000);
    specification.seed = 2;
    let train = post("/train", &serde_json::to_string(&specification)?);
    let job = LoadConnection::open(server.addresses[0]).await?.exchange(&train).await?.to_vec();
    text(&serde_json::from_slice(&job)?, "job")
}

/// Returns the coming period of each session.
pub async fn periods(server: &Server, clients: usize, sessions: &[String]) -> Result<Vec<u64>, Box<dyn Error>> {
    let requests: Vec<_> = sessions.iter().map(|session| get(&format!("/sessions/{session}"))).collect();
    let answers = bodies(server.addresses[0], clients, &requests).await?;
    answers
        .iter()
        .map(|body| {
            let session: Value = serde_json::from_slice(body)?;
            session["period"].as_u64().ok_or_else(|| format!("no period in {session}").into())
        })
        .collect()
}

fn text(value: &Value, field: &str) -> Result<String, Box<dyn Error>> {
    value[field].as_str().map(str::to_owned).ok_or_else(|| format!("no {field} in {value}").into())
}
