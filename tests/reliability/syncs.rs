//! The n-th fsync fails, or is the last thing the process does. A failed one must end the process: the kernel may have
//! dropped the pages, so what is in memory can no longer be trusted.

use std::os::unix::process::ExitStatusExt;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::caller::Caller;
use crate::load::Load;
use crate::mount::skip;
use crate::scene::{Outcome, Tally, import};
use crate::server::Site;
use crate::tracer::Tracer;

const CLIENTS: usize = 6;
const EXIT_STORE_FAILED: i32 = 74;
const SIGKILL: i32 = 9;

pub async fn failed(trials: usize) -> Outcome {
    broken(trials, "error=EIO", |status| status.code() == Some(EXIT_STORE_FAILED)).await
}

pub async fn killed(trials: usize) -> Outcome {
    broken(trials, "signal=KILL", |status| status.signal() == Some(SIGKILL)).await
}

async fn broken(trials: usize, how: &str, as_it_must: fn(&std::process::ExitStatus) -> bool) -> Outcome {
    let (site, mut tally, mut keys) = (Site::new(), Tally::default(), 0);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut server = site.start().await?;
    let policy = import(&Caller::new(&[&server.url])).await;
    for trial in 0..trials {
        let number = random.random_range(1..80);
        let Some(tracer) = Tracer::of_fsync(&server.pid(), &format!("{how}:when={number}")) else {
            return skip("no strace, or it may not trace");
        };
        let load = Load::start(&[&server.url], &policy, CLIENTS, trial as u64);
        let status = server.ended().await.ok_or(format!("it carried on after fsync {number} ({how})"))?;
        drop(tracer);
        if !as_it_must(&status) {
            tally.complain(format!("after fsync {number} ({how}) it ended with {status}"));
        }
        let mut ledger = load.stop().await;
        // The failure itself was told to whoever waited for it.
        ledger.complaints.retain(|complaint| !complaint.contains("/problems/internal"));
        server = site.start().await?;
        tally.recovered(&server, &ledger, &mut keys).await;
    }
    tally.inspect(&site).await;
    tally.listen(&site);
    Ok(Some(tally))
}
