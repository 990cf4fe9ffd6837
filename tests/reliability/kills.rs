//! The process is killed, or asked to end, at a random moment of a mixed load.

use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::caller::Caller;
use crate::load::Load;
use crate::scene::{Outcome, Tally, import};
use crate::server::Site;

const CLIENTS: usize = 6;
const REPORTS: std::ops::Range<usize> = 1..200;

pub async fn killed(trials: usize) -> Outcome {
    interrupted(trials, "-KILL").await
}

pub async fn terminated(trials: usize) -> Outcome {
    interrupted(trials, "-TERM").await
}

async fn interrupted(trials: usize, signal: &str) -> Outcome {
    let (site, mut tally, mut keys) = (Site::new(), Tally::default(), 0);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut server = site.start().await?;
    let policy = import(&Caller::new(&[&server.url])).await;
    for trial in 0..trials {
        if signal == "-TERM" {
            tally.deaths = 0;
        }
        let load = Load::start(&[&server.url], &policy, CLIENTS, trial as u64);
        load.acknowledges(random.random_range(REPORTS)).await;
        tokio::time::sleep(Duration::from_micros(random.random_range(0..5000))).await;
        server.signal(signal);
        let status = server.ended().await.ok_or("it did not end")?;
        let ledger = load.stop().await;
        if signal == "-TERM" && status.code() != Some(0) {
            tally.complain(format!("ended with {status}"));
        }
        server = site.start().await?;
        tally.recovered(&server, &ledger, &mut keys).await;
    }
    tally.inspect(&site).await;
    tally.listen(&site);
    Ok(Some(tally))
}
