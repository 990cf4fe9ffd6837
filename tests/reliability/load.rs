//! Mixed load: clients that open sessions, report, ask, repeat themselves and queue trainings until they are stopped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tokio::task::JoinHandle;

use crate::caller::{Answer, Caller};
use crate::ledger::{Ledger, Session, Training};
use crate::scene::{HORIZON, specification};

/// Pause after no answer.
const PAUSE: Duration = Duration::from_millis(5);
/// Steps of the trainings of a client: one that ends within a trial, and one that hardly does.
const TRAININGS: [usize; 2] = [2, HORIZON];

pub struct Load {
    clients: Vec<JoinHandle<Ledger>>,
    stop: Arc<AtomicBool>,
    answered: Arc<AtomicUsize>,
}

impl Load {
    /// Clients of the replicas at `urls`; `seed` decides what each of them does.
    pub fn start(urls: &[&str], policy: &str, clients: usize, seed: u64) -> Load {
        Load::of(&Caller::new(urls), urls.len(), policy, clients, seed)
    }

    /// Clients that call as `caller`, each beginning with another of its replicas.
    pub fn of(caller: &Caller, replicas: usize, policy: &str, clients: usize, seed: u64) -> Load {
        let (stop, answered) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let clients = (0..clients).map(|number| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(number as u64);
            let mut caller = caller.another();
            (0..number % replicas).for_each(|_| caller.turn());
            let client = Client {
                caller,
                random,
                policy: policy.to_owned(),
                name: format!("{seed}-{number}"),
                ledger: Ledger::default(),
                answered: answered.clone(),
            };
            tokio::spawn(client.live(stop.clone()))
        });
        Load { clients: clients.collect(), stop, answered }
    }

    /// Waits until so many more reports are acknowledged, for 20 s at most: under a fault there may be none.
    pub async fn acknowledges(&self, reports: usize) {
        let (waiting_since, start) = (Instant::now(), self.answered.load(Ordering::Relaxed));
        while self.answered.load(Ordering::Relaxed) < start + reports
            && waiting_since.elapsed() < Duration::from_secs(20)
        {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    /// Everything that was acknowledged.
    pub async fn stop(self) -> Ledger {
        self.stop.store(true, Ordering::Relaxed);
        let mut all = Ledger::default();
        for client in self.clients {
            all.extend(client.await.unwrap());
        }
        all
    }
}

struct Client {
    caller: Caller,
    random: ChaCha8Rng,
    policy: String,
    name: String,
    ledger: Ledger,
    answered: Arc<AtomicUsize>,
}

impl Client {
    async fn live(mut self, stop: Arc<AtomicBool>) -> Ledger {
        while !stop.load(Ordering::Relaxed) {
            let answered = match self.random.random_range(0..100) {
                0..70 => self.report().await,
                70..85 => self.ask().await,
                85..95 => self.repeat().await,
                _ => self.train().await,
            };
            if !answered {
                self.caller.turn();
                tokio::time::sleep(PAUSE).await;
            }
        }
        self.ledger
    }

    /// Returns true if the answer has the expected status; any other but "not now" is a complaint.
    fn expects(&mut self, expected: u16, what: &str, answer: &Option<Answer>) -> bool {
        match answer {
            Some((status, body)) if *status != expected && !matches!(status, 503 | 507) => {
                self.ledger.complaints.push(format!("{what}: {status} {body}"));
                false
            }
            Some((status, _)) => *status == expected,
            None => false,
        }
    }

    /// Reports the next period of the last session, puts one of it right, or opens another session; what is without an
    /// answer is sent again.
    async fn report(&mut self) -> bool {
        let goes_on = |session: &&mut Session| session.reports.len() < HORIZON || session.pending.is_some();
        let Some(session) = self.ledger.sessions.last_mut().filter(goes_on) else {
            return self.open().await;
        };
        let (observed, log_return) = (session.reports.len(), self.random.random_range(-0.05..0.05));
        let new = if observed > 0 && self.random.random_bool(0.2) {
            let (correction, period) = (session.corrections.len() + 1, self.random.random_range(1..=observed));
            json!({ "correction": correction, "period": period, "log_return": log_return, "reason": "revised" })
        } else {
            json!({ "session": session.name, "period": observed + 1, "log_return": log_return })
        };
        let entry = session.pending.get_or_insert(new).clone();
        let answer = session.send(&self.caller, &entry).await;
        if !self.expects(200, "a report", &answer) {
            return false;
        }
        if let (Some(session), Some((_, answer))) = (self.ledger.sessions.last_mut(), answer) {
            session.pending = None;
            session.acknowledge(entry, answer);
            self.answered.fetch_add(1, Ordering::Relaxed);
        }
        true
    }

    async fn open(&mut self) -> bool {
        let opened = self.caller.post("/sessions", &json!({ "policy": self.policy })).await;
        if !self.expects(201, "a session", &opened) {
            return false;
        }
        let name = opened.and_then(|(_, session)| session["session"].as_str().map(str::to_owned)).unwrap_or_default();
        self.ledger.sessions.push(Session::opened(name));
        true
    }

    /// The advice is for the period after the last acknowledged, or after the one that is pending.
    async fn ask(&mut self) -> bool {
        let Some(session) = self.ledger.sessions.last() else { return true };
        let (observed, pending) = (session.reports.len(), session.pending.is_some());
        if observed + usize::from(pending) >= HORIZON {
            return true;
        }
        let answer = self.caller.get(&format!("/action?session={}", session.name)).await;
        if !self.expects(200, "an action", &answer) {
            return false;
        }
        let period = answer.and_then(|(_, action)| action["period"].as_u64()).unwrap_or_default() as usize;
        if !(observed + 1..=observed + 1 + usize::from(pending)).contains(&period) {
            self.ledger.stale += 1;
            self.ledger.complaints.push(format!("advice for period {period} after {observed} acknowledged"));
        }
        true
    }

    /// Sends an acknowledged report again: the first answer, or none.
    async fn repeat(&mut self) -> bool {
        let Some(session) = self.ledger.sessions.last().filter(|session| !session.reports.is_empty()) else {
            return true;
        };
        let (report, first) = session.reports[self.random.random_range(0..session.reports.len())].clone();
        let answer = self.caller.post("/observe", &report).await;
        if !self.expects(200, "a repeat", &answer) {
            return false;
        }
        let same = answer.is_some_and(|(_, again)| again == first);
        if !same {
            self.ledger.complaints.push(format!("another answer to {report}"));
        }
        true
    }

    /// Queues a training, or looks how one is doing.
    async fn train(&mut self) -> bool {
        let waiting = self.ledger.trainings.iter().position(|training| training.job.is_none());
        let count = self.ledger.trainings.len();
        if waiting.is_none() && count == TRAININGS.len() {
            let index = self.random.random_range(0..count);
            return self.look(index).await;
        }
        let index = waiting.unwrap_or(count);
        if waiting.is_none() {
            let (key, request) = (format!("{}-{count}", self.name), specification(TRAININGS[count]));
            self.ledger.trainings.push(Training { key, request, job: None, ended: None });
        }
        let training = &self.ledger.trainings[index];
        let answer = self.caller.train(&training.key, &training.request).await;
        if !self.expects(202, "a training", &answer) {
            return false;
        }
        self.ledger.trainings[index].job = answer.and_then(|(_, job)| job["job"].as_str().map(str::to_owned));
        true
    }

    async fn look(&mut self, index: usize) -> bool {
        let Some(job) = self.ledger.trainings[index].job.clone() else { return true };
        let answer = self.caller.get(&format!("/jobs/{job}")).await;
        if !self.expects(200, "a job", &answer) {
            return false;
        }
        self.ledger.trainings[index].ended =
            answer.map(|(_, job)| job).filter(|job: &Value| job["finished_ms"].is_i64());
        true
    }
}
