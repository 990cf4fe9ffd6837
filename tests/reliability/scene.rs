//! The scene of every fault: a policy, its sessions and trainings, and the count of what came of it.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Duration;

use ballast::control::policy::content_hash;
use serde_json::{Value, json};

use crate::caller::Caller;
use crate::ledger::{Audit, Ledger};
use crate::server::{Server, Site};
use crate::support::patience::within;
use crate::support::{self, trained};

/// Periods of a session.
pub const HORIZON: usize = 50;
/// A server with an intact folder is ready this soon.
const READY: Duration = Duration::from_secs(2);

/// The result of a row; `None` if this machine cannot make the fault.
pub type Outcome = Result<Option<Tally>, String>;

/// A small training, with a radius at which the advice is not always to stay in the bank.
pub fn specification(horizon: usize) -> Value {
    let mut specification = support::specification(horizon);
    specification["problem"]["radius"]["scale"] = json!(0.1);
    specification
}

/// A training whose request is some hundreds of kilobytes.
pub fn large_specification() -> Value {
    let mut large = specification(2);
    large["problem"]["history"] = (0..20_000).map(|index| Value::from(0.02 * f64::from(index).sin())).collect();
    large["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
    large
}

/// The policy that a training of so many steps gives when nothing disturbs it.
pub fn undisturbed(steps: usize) -> Vec<u8> {
    static POLICIES: Mutex<BTreeMap<usize, Vec<u8>>> = Mutex::new(BTreeMap::new());
    POLICIES.lock().unwrap().entry(steps).or_insert_with(|| trained(&specification(steps))).clone()
}

/// Brings a policy of [`HORIZON`] periods in; its name.
pub async fn import(caller: &Caller) -> String {
    let policy = serde_json::from_slice(&undisturbed(HORIZON)).unwrap();
    let (status, imported) = caller.post("/policies/import", &policy).await.unwrap();
    assert_eq!(status, 201, "{imported}");
    imported["policy"].as_str().unwrap().to_owned()
}

/// The fault, and its result.
#[derive(Default)]
pub struct Tally {
    pub trials: usize,
    pub faults: usize,
    /// Processes that died without a word.
    pub deaths: usize,
    pub audit: Audit,
    pub stale: usize,
    pub panics: usize,
    /// The slowest start.
    pub ready: Duration,
    pub complaints: Vec<String>,
    /// A note for readers of the row.
    pub note: String,
}

impl Tally {
    pub fn is_sound(&self) -> bool {
        let Audit { acknowledged, lost, doubled } = self.audit;
        acknowledged > 0 && (lost, doubled, self.stale, self.panics) == (0, 0, 0, 0) && self.complaints.is_empty()
    }

    pub fn complain(&mut self, complaint: impl Into<String>) {
        self.complaints.push(complaint.into());
    }

    /// Notes what the servers of `site` said of panics.
    pub fn listen(&mut self, site: &Site) {
        let panics = site.panics();
        self.panics += panics.len();
        self.complaints.extend(panics);
    }

    /// Notes how long a server took to get ready.
    pub fn started(&mut self, server: &Server) {
        self.ready = self.ready.max(server.ready);
        if server.ready > within(READY) {
            self.complain(format!("ready only after {} ms", server.ready.as_millis()));
        }
    }

    /// Complains where the database of `site` is not whole.
    pub async fn inspect(&mut self, site: &Site) {
        let found = site.integrity().await;
        if found != "ok" {
            self.complain(found);
        }
    }

    /// Counts a trial with one fault, after which `server` must know all that is in `ledger`.
    pub async fn recovered(&mut self, server: &Server, ledger: &Ledger, keys: &mut usize) {
        self.started(server);
        self.deaths += 1;
        self.examine(ledger, &Caller::new(&[&server.url]), keys).await;
        self.trials += 1;
        self.faults += 1;
    }

    /// Asks for everything in `ledger` and counts the jobs, of which there must be one for each of `keys` and those new.
    pub async fn examine(&mut self, ledger: &Ledger, caller: &Caller, keys: &mut usize) {
        self.audit += ledger.audit(caller).await;
        self.stale += ledger.stale;
        self.complaints.extend(ledger.complaints.iter().cloned());
        *keys += ledger.trainings.len();
        let Some(jobs) = caller.jobs().await else { return self.complain("the jobs are not to be had") };
        self.audit.doubled += jobs.len().saturating_sub(*keys);
        self.audit.lost += keys.saturating_sub(jobs.len());
        for job in &jobs {
            let steps = job["progress"]["steps_total"].as_u64().unwrap_or_default() as usize;
            let sound = match job["state"].as_str() {
                Some("queued" | "running") => true,
                Some("succeeded") => job["policy"] == content_hash(&undisturbed(steps)),
                // Three may die under it before it has solved one step.
                Some("failed") if self.deaths >= 3 => {
                    job["error"].as_str().is_some_and(|error| error.starts_with("its worker process ended 3 times"))
                }
                _ => false,
            };
            if !sound {
                self.complain(format!("not what an undisturbed training gives: {job}"));
            }
        }
    }
}
