//! A server with two tenants: one lives by it, the other is about to attack.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ballast::store::KeyRing;
use serde_json::{Value, json};
use tokio::runtime::Handle;
use tokio::task::JoinHandle;

use crate::caller::Caller;
use crate::load::Load;
use crate::neighbours::Attack;
use crate::scene::{Outcome, Tally, import};
use crate::server::{Server, Site};
use crate::support::issue_key;
use crate::support::patience::until;

const CLIENTS: usize = 3;
/// Reports acknowledged before an attack and after it.
const REPORTS: usize = 20;
/// Between two heartbeats.
const BEAT: Duration = Duration::from_millis(20);

pub struct Tenants {
    pub site: Site,
    pub server: Server,
    /// Acts for the tenant that is attacked.
    pub owner: Caller,
    /// Acts for the other, with every role but admin's.
    pub neighbour: Caller,
    pub policy: String,
    /// Trainings acknowledged to the owner.
    pub trainings: usize,
}

impl Tenants {
    async fn start(site: Site, tally: &mut Tally) -> Result<Tenants, String> {
        std::fs::create_dir_all(site.data()).unwrap();
        let mut keys = Vec::new();
        for tenant in ["north", "south"] {
            let ring = KeyRing::open(&site.data()).await.map_err(|error| error.to_string())?;
            keys.push(issue_key(&ring, tenant, "read,operate,train").await);
        }
        let server = site.start().await?;
        tally.started(&server);
        let [owner, neighbour] = [&keys[0], &keys[1]].map(|key| Caller::with_key(&server.url, key));
        let policy = import(&owner).await;
        Ok(Tenants { site, server, owner, neighbour, policy, trainings: 0 })
    }

    /// So many attacks on a server over `site`.
    pub async fn attacked(site: Site, trials: usize, attack: Attack) -> Outcome {
        // The compiler does not see that a future this deep may change its thread.
        let attacking = move || Handle::current().block_on(Tenants::attacked_here(site, trials, attack));
        tokio::task::spawn_blocking(attacking).await.unwrap_or_else(|panic| Err(panic.to_string()))
    }

    async fn attacked_here(site: Site, trials: usize, attack: Attack) -> Outcome {
        let mut tally = Tally::default();
        let mut tenants = Tenants::start(site, &mut tally).await?;
        for _ in 0..trials {
            tenants.under(attack, &mut tally).await?;
        }
        Ok(Some(tally))
    }

    /// The owner's load while `attack` lasts, and everything it was acknowledged after; the attack gives its calls.
    async fn under(&mut self, attack: Attack, tally: &mut Tally) -> Result<(), String> {
        let load = Load::of(&self.owner, 1, &self.policy, CLIENTS, tally.trials as u64);
        load.acknowledges(REPORTS).await;
        tally.faults += attack.run(self, tally).await?;
        load.acknowledges(REPORTS).await;
        let mut ledger = load.stop().await;
        if attack.fails_reads() {
            ledger.complaints.retain(|complaint| !complaint.contains(": 500 "));
        }
        if !self.server.lives() {
            tally.complain("the server ended");
        }
        tally.examine(&ledger, &self.owner, &mut self.trainings).await;
        tally.trials += 1;
        tally.inspect(&self.site).await;
        tally.listen(&self.site);
        Ok(())
    }

    /// Asks for the owner's advice again and again.
    pub async fn pulse(&self, question: &'static str) -> Result<Pulse, String> {
        let caller = self.owner.another();
        let session = caller.open(&self.policy).await.ok_or("no session")?;
        let first = json!({ "session": session, "period": 1, "log_return": 0.01 });
        caller.post("/observe", &first).await.ok_or("no report")?;
        Ok(Pulse::of(caller, format!("/action?session={session}{question}")))
    }

    /// Callers of so many more tenants, of whom the server has learnt.
    pub async fn others(&self, count: usize) -> Result<Vec<Caller>, String> {
        let mut others = Vec::new();
        for number in 0..count {
            let ring = KeyRing::open(&self.site.data()).await.map_err(|error| error.to_string())?;
            let key = issue_key(&ring, &format!("other-{number}"), "read").await;
            others.push(Caller::with_key(&self.server.url, &key));
        }
        let last = others.last().ok_or("nobody")?;
        until("the keys to be known", async || matches!(last.get("/sessions").await, Some((200, _))).then_some(()))
            .await;
        Ok(others)
    }
}

/// A client that asks one thing at a steady rate.
pub struct Pulse {
    beating: JoinHandle<Pace>,
    over: Arc<AtomicBool>,
}

/// How a pulse was answered.
#[derive(Default)]
pub struct Pace {
    milliseconds: Vec<u128>,
    /// Answers other than 200.
    pub missed: Vec<String>,
}

impl Pulse {
    /// `caller` asks for `path`.
    pub fn of(caller: Caller, path: String) -> Pulse {
        let over = Arc::new(AtomicBool::new(false));
        Pulse { beating: tokio::spawn(beat(caller, path, over.clone())), over }
    }

    pub async fn stop(self) -> Pace {
        self.over.store(true, Ordering::Relaxed);
        self.beating.await.unwrap()
    }
}

impl Pace {
    /// The 99th percentile, in milliseconds.
    pub fn p99(&self) -> u128 {
        let mut sorted = self.milliseconds.clone();
        sorted.sort_unstable();
        sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(u128::MAX)
    }

    /// Notes the pace, and complains of what was missed or took longer than `limit` in one of a hundred.
    pub fn report(&self, limit: Duration, tally: &mut Tally) {
        tally.note = format!("{} asked, p99 {} ms", self.milliseconds.len(), self.p99());
        tally.complaints.extend(self.missed.iter().take(3).cloned());
        if self.p99() > limit.as_millis() {
            tally.complain(format!("the 99th percentile is {} ms, not {}", self.p99(), limit.as_millis()));
        }
    }
}

async fn beat(caller: Caller, path: String, over: Arc<AtomicBool>) -> Pace {
    let mut pace = Pace::default();
    while !over.load(Ordering::Relaxed) {
        let started = Instant::now();
        let answer = caller.get(&path).await;
        pace.milliseconds.push(started.elapsed().as_millis());
        if !matches!(answer, Some((200, _))) {
            pace.missed.push(format!(
                "{path}: {}",
                answer.map_or("no answer".into(), |(status, body)| format!("{status} {body}"))
            ));
        }
        tokio::time::sleep(BEAT.saturating_sub(started.elapsed())).await;
    }
    pace
}

/// The names of a caller's newest sessions.
pub async fn sessions(caller: &Caller) -> Vec<String> {
    let Some((200, page)) = caller.get("/sessions?limit=50").await else { return Vec::new() };
    let name = |row: &Value| row["session"].as_str().map(str::to_owned);
    page["sessions"].as_array().map_or(Vec::new(), |rows| rows.iter().filter_map(name).collect())
}
