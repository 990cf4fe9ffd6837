//! Two replicas that answer and two that work over one PostgreSQL: each is killed or stopped past its lease in turn, and so
//! is the server of the database. Every job ends once, in the policy that an undisturbed training gives.

use std::time::{Duration, Instant};

use serde_json::Value;

use crate::caller::Caller;
use crate::load::Load;
use crate::mount::skip;
use crate::scene::{Outcome, Tally, import};
use crate::server::Site;
use crate::support::patience::within;
use crate::support::postgres::{Cluster, private_cluster};

const CLIENTS: usize = 4;
const LEASE_SECONDS: u64 = 2;
const PATIENCE: Duration = Duration::from_secs(90);

pub async fn crashed(trials: usize) -> Outcome {
    let Some(cluster) = private_cluster() else { return skip("no PostgreSQL") };
    let mut tally = Tally::default();
    for trial in 0..trials {
        crash_all(&cluster, trial as u64, &mut tally).await?;
        tally.trials += 1;
    }
    Ok(Some(tally))
}

async fn crash_all(cluster: &Cluster, seed: u64, tally: &mut Tally) -> Result<(), String> {
    let store = cluster.database().await;
    let lease = LEASE_SECONDS.to_string();
    let site = |role| Site::with(&["--store", &store, "--lease-seconds", &lease, "--role", role]);
    let (answering, working) = (site("api"), site("worker"));
    let (api, mut other_api) = (answering.start().await?, answering.start().await?);
    let (mut worker, second_worker) = (working.start().await?, working.start().await?);
    let caller = Caller::new(&[&api.url]);
    let policy = import(&caller).await;
    let load = Load::start(&[&api.url, &other_api.url], &policy, CLIENTS, seed);

    load.acknowledges(50).await;
    worker.signal("-KILL");
    worker.ended().await.ok_or("it did not end")?;
    load.acknowledges(20).await;
    second_worker.signal("-STOP");
    worker = working.start().await?;
    tally.started(&worker);
    // A lease runs out by time alone, and whether one was held by then is the load's.
    tokio::time::sleep(Duration::from_secs(LEASE_SECONDS + 1)).await;
    second_worker.signal("-CONT");
    load.acknowledges(20).await;
    tokio::task::block_in_place(|| {
        cluster.crash();
        cluster.recover();
    });
    load.acknowledges(20).await;
    other_api.signal("-KILL");
    other_api.ended().await.ok_or("it did not end")?;
    other_api = answering.start().await?;
    tally.started(&other_api);
    load.acknowledges(20).await;
    tally.faults += 4;

    let ledger = load.stop().await;
    until_idle(&caller).await?;
    tally.examine(&ledger, &Caller::new(&[&other_api.url]), &mut 0).await;
    tally.listen(&answering);
    tally.listen(&working);
    Ok(())
}

/// Waits until every job has ended.
async fn until_idle(caller: &Caller) -> Result<(), String> {
    let started = Instant::now();
    loop {
        let jobs = caller.jobs().await.ok_or("no jobs")?;
        if jobs.iter().all(|job: &Value| job["finished_ms"].is_i64()) {
            return Ok(());
        }
        if started.elapsed() > within(PATIENCE) {
            return Err(format!("still not ended: {jobs:?}"));
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
