//! The scenarios: the calls to the service, and the bounds on its answers.

use std::error::Error;
use std::time::{Duration, Instant};

use super::connection::{LoadConnection, get, post};
use super::figures::{LoadBound, LoadReport, Must};
use super::load::{Load, paced, saturate};
use super::populate::{LoadFixture, long_training, periods};
use super::server::Server;
use super::stored::Growth;
use super::{LoadTest, Scenario, limits, tell};

const OBSERVES_PER_SECOND: f64 = 8000.0;
const OBSERVE_P99_MS: f64 = 40.0;
const IDLE_P99_MS: f64 = 2.0;
const TRAINING_P99_MS: f64 = 10.0;
const SHARE_OF_LIVEZ: f64 = 0.6;
const START_SECONDS: f64 = 5.0;
const MEMORY_MB: f64 = 1024.0;
/// Requests per second that leave the service idle most of the time.
const LOW_RATE: f64 = 200.0;
/// Number of turns that two loads take in one comparison.
const TURNS: u32 = 6;

pub async fn run(arguments: &LoadTest, server: &mut Server, report: &mut LoadReport) -> Result<(), Box<dyn Error>> {
    let time = Duration::from_secs_f64(arguments.seconds);
    if let Some(folder) = server.folder() {
        tell("syncing the disk");
        let rate = limits::syncs_per_second(folder, time / 3)?;
        report.rate("limit: pages written and synced, one by one", rate);
    }
    if let (Some(folder), Some(store)) = (server.folder(), server.store()) {
        tell("inserting rows by pgbench");
        match limits::inserts_per_second(folder, store, time).await? {
            Some(rate) => {
                report.rate(format!("limit: pgbench, a row a commit, {} connections", limits::CONNECTIONS), rate)
            }
            None => report.note("pgbench is not installed, so the database itself was not measured"),
        }
    }
    let world = LoadFixture::train(server, arguments).await?;
    let test = Test { arguments, world, clients: usize::from(arguments.clients), time };
    if arguments.runs(Scenario::Observe) {
        test.observe(server, report).await?;
    }
    if [Scenario::ActionVsLivez, Scenario::ActionIdle, Scenario::ActionWhileTraining]
        .iter()
        .any(|&one| arguments.runs(one))
    {
        let sessions = test.world.open(server, test.clients, arguments.sessions).await?;
        // The first step is solved at one state; from the second on a step answers from its surrogates.
        test.observed(server, &sessions, 1..=1, 1).await?;
        test.actions(server, report, &sessions).await?;
    }
    if arguments.runs(Scenario::Sessions100k) {
        test.many(server, report).await?;
    }
    Ok(())
}

struct Test<'a> {
    arguments: &'a LoadTest,
    world: LoadFixture,
    clients: usize,
    time: Duration,
}

impl Test<'_> {
    /// Takes every session through `periods`; each client has its own sessions, and reports `batch` of them per call.
    async fn observed(
        &self,
        server: &Server,
        sessions: &[String],
        periods: std::ops::RangeInclusive<usize>,
        batch: usize,
    ) -> Result<Load, Box<dyn Error>> {
        let clients = self.clients.min(sessions.len().div_ceil(batch));
        let own: Vec<Vec<(usize, &String)>> =
            (0..clients).map(|client| sessions.iter().enumerate().skip(client).step_by(clients).collect()).collect();
        let (own, world) = (&own, &self.world);
        let requests = |client: usize| {
            let calls = move |period| own[client].chunks(batch).map(move |some| world.observation(some, period));
            periods.clone().flat_map(calls)
        };
        let load = Load::on(server, saturate(&server.addresses, clients, requests)).await?;
        Ok(load.asking(sessions.len() * periods.clone().count()))
    }

    async fn observe(&self, server: &Server, report: &mut LoadReport) -> Result<(), Box<dyn Error>> {
        let (count, horizon, batch) = (self.arguments.sessions, self.world.horizon, self.arguments.batch.into());
        let (mut load, mut growth) = (Load::default(), Growth::default());
        for _ in 0..self.arguments.rounds {
            growth.start(server).await?;
            let sessions = self.world.open(server, self.clients, count).await?;
            growth.opened(server).await?;
            tell(&format!("{} observations from {} clients", sessions.len() * horizon, self.clients));
            load.add(self.observed(server, &sessions, 1..=horizon, batch).await?);
            growth.observed(server).await?;
            let coming = periods(server, self.clients, &sessions).await?;
            if let Some(period) = coming.iter().find(|&&period| period != horizon as u64 + 1) {
                return Err(format!("a session is at period {period} after {horizon} observations").into());
            }
        }
        // The latency of a list is not that of one observation.
        let must = Must { rate: Some(OBSERVES_PER_SECOND), p99_ms: (batch == 1).then_some(OBSERVE_P99_MS) };
        let lists = if batch == 1 { String::new() } else { format!(", lists of {batch}") };
        report.load(format!("observe: {} clients, {count} sessions{lists}", self.clients), &load, must);
        growth.tell(load.operations() / horizon, load.operations(), report);
        Ok(())
    }

    async fn actions(
        &self,
        server: &Server,
        report: &mut LoadReport,
        sessions: &[String],
    ) -> Result<(), Box<dyn Error>> {
        if self.arguments.runs(Scenario::ActionVsLivez) {
            self.against_livez(server, report, sessions).await?;
        }
        if self.arguments.runs(Scenario::ActionIdle) {
            tell("requesting advice at a low rate");
            let load = self.now_and_then(server, sessions).await?;
            let must = Must { p99_ms: Some(IDLE_P99_MS), ..Must::default() };
            report.load("action-idle: first and later requests", &load, must);
        }
        if self.arguments.runs(Scenario::ActionWhileTraining) {
            self.observed(server, sessions, 2..=2, 1).await?;
            tell("the same while 1,000 design points are trained");
            let job = long_training(server).await?;
            let load = self.now_and_then(server, sessions).await?;
            let cancel = post(&format!("/jobs/{job}/cancel"), "{}");
            LoadConnection::open(server.addresses[0]).await?.exchange(&cancel).await?;
            let must = Must { p99_ms: Some(TRAINING_P99_MS), ..Must::default() };
            report.load("action-while-training", &load, must);
        }
        Ok(())
    }

    async fn now_and_then(&self, server: &Server, sessions: &[String]) -> Result<Load, Box<dyn Error>> {
        let ask = |turn: usize| action(&sessions[turn % sessions.len()]);
        Ok(Load::on(server, paced(server.addresses[0], LOW_RATE, self.time, ask)).await?)
    }

    /// Alternates the two loads, so that other work on the machine affects both.
    async fn against_livez(
        &self,
        server: &Server,
        report: &mut LoadReport,
        sessions: &[String],
    ) -> Result<(), Box<dyn Error>> {
        tell("requesting advice and /livez in turns");
        let actions: Vec<_> = sessions.iter().map(|session| action(session)).collect();
        let own = |client: usize| actions.iter().skip(client).step_by(self.clients).cloned();
        let first = Load::on(server, saturate(&server.addresses, self.clients, own)).await?;
        report.load("action: first requests, all clients", &first, Must::default());
        let (mut livez, mut actions_load) = (Load::default(), Load::default());
        for _ in 0..TURNS {
            let alive = |_| self.for_a_turn(std::iter::repeat(get("/livez")));
            livez.add(Load::on(server, saturate(&server.addresses, self.clients, alive)).await?);
            let advised = |client| self.for_a_turn(actions.iter().cycle().skip(17 * client).cloned());
            actions_load.add(Load::on(server, saturate(&server.addresses, self.clients, advised)).await?);
        }
        report.load(format!("limit: /livez, {} clients", self.clients), &livez, Must::default());
        report.load(format!("action: {} clients, in turns with /livez", self.clients), &actions_load, Must::default());
        let share = actions_load.rate() / livez.rate();
        report.bounded(
            format!("action-vs-livez: {share:.2} of its rate"),
            LoadBound::at_least(share, SHARE_OF_LIVEZ, "of /livez"),
        );
        Ok(())
    }

    fn for_a_turn(&self, requests: impl Iterator<Item = Vec<u8>>) -> impl Iterator<Item = Vec<u8>> {
        let end = Instant::now() + self.time / TURNS;
        requests.take_while(move |_| Instant::now() < end)
    }

    async fn many(&self, server: &mut Server, report: &mut LoadReport) -> Result<(), Box<dyn Error>> {
        let count = self.arguments.live_sessions;
        let mut sessions = Vec::new();
        let world = &self.world;
        let ready = server
            .restart::<Box<dyn Error>>(async |folder, store| {
                sessions = world.fill(folder, store, count).await?;
                Ok(())
            })
            .await?;
        let Some(ready) = ready else {
            report.note(
                "sessions-100k was skipped: it writes into the store itself, so it needs a service that this command starts",
            );
            return Ok(());
        };
        report.note(format!("the {count} sessions were written through the library's store, not over HTTP"));
        let seconds = ready.as_secs_f64();
        let start = LoadBound::below(seconds, START_SECONDS, "s");
        report.bounded(format!("sessions-100k: {seconds:.2} s from start to ready"), start);
        tell(&format!("{count} sessions observe and are advised"));
        let observed = self.observed(server, &sessions, 1..=1, 1).await?;
        let must = Must { rate: None, p99_ms: Some(OBSERVE_P99_MS) };
        report.load("sessions-100k: each observes, read from the store", &observed, must);
        let observed = self.observed(server, &sessions, 2..=2, 1).await?;
        let must = Must { rate: Some(OBSERVES_PER_SECOND), p99_ms: Some(OBSERVE_P99_MS) };
        report.load("sessions-100k: each observes again", &observed, must);
        let load = self.now_and_then(server, &sessions).await?;
        let must = Must { p99_ms: Some(IDLE_P99_MS), ..Must::default() };
        report.load("sessions-100k: action-idle", &load, must);
        if let Some(memory) = server.peak_memory_mb() {
            let bound = LoadBound::below(memory, MEMORY_MB, "MB");
            report.bounded(format!("sessions-100k: {memory:.0} MB resident at most"), bound);
        }
        Ok(())
    }
}

fn action(session: &str) -> Vec<u8> {
    get(&format!("/action?session={session}"))
}
