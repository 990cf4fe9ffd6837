//! The power goes under load: on an ext4 of its own nothing outlives the moment but what was fsynced.
//!
//! The control answers every fsync without doing it, which must lose acknowledged facts; it shows that the cut cuts.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::caller::Caller;
use crate::ledger::{Audit, Ledger};
use crate::load::Load;
use crate::mount::{Mount, skip};
use crate::scene::{Outcome, Tally, import};
use crate::server::{Server, Site};
use crate::tracer::Tracer;

const MEGABYTES: u64 = 64;
const CLIENTS: usize = 6;
const EXIT_STORE_FAILED: i32 = 74;

pub async fn cut(trials: usize) -> Outcome {
    let Some(mount) = Mount::on_loop(MEGABYTES) else { return skip("no ext4 on a loop device: mount needs root") };
    let (site, mut tally, mut keys) = (Site::at(&mount.path().join("data")), Tally::default(), 0);
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut server = site.start().await?;
    let policy = import(&Caller::new(&[&server.url])).await;
    for trial in 0..trials {
        let load = Load::start(&[&server.url], &policy, CLIENTS, trial as u64);
        load.acknowledges(random.random_range(1..200)).await;
        let ledger = cut_off(&mount, server, load, &mut tally).await?;
        server = site.start().await?;
        tally.recovered(&server, &ledger, &mut keys).await;
        tally.inspect(&site).await;
    }
    tally.listen(&site);
    Ok(Some(tally))
}

/// Cuts the power, sees the server end by itself, and brings the power back.
async fn cut_off(mount: &Mount, mut server: Server, load: Load, tally: &mut Tally) -> Result<Ledger, String> {
    // An fsync under way when the file system is shut down may report success to nobody's good: after a real cut nobody
    // is left to hear it. So the process is still while the power goes, and then finds its disk gone.
    server.freeze().await;
    mount.cut();
    server.signal("-CONT");
    let status = server.ended().await.ok_or("it did not end without a disk")?;
    if status.code() != Some(EXIT_STORE_FAILED) {
        tally.complain(format!("without a disk it ended with {status}"));
    }
    drop(server);
    let mut ledger = load.stop().await;
    // The failure itself was told to whoever waited for it.
    ledger.complaints.retain(|complaint| !complaint.contains("/problems/internal"));
    mount.restore()?;
    Ok(ledger)
}

pub async fn cut_without_fsync(trials: usize) -> Outcome {
    let mut tally = Tally { note: "the control: must lose".into(), ..Tally::default() };
    for trial in 0..trials {
        let Some(mount) = Mount::on_loop(MEGABYTES) else { return skip("no ext4 on a loop device: mount needs root") };
        let site = Site::at(&mount.path().join("data"));
        let server = site.start().await?;
        let policy = import(&Caller::new(&[&server.url])).await;
        let Some(tracer) = Tracer::of_fsync(&server.pid(), "retval=0") else { return skip("no strace") };
        let load = Load::start(&[&server.url], &policy, CLIENTS, trial as u64);
        load.acknowledges(200).await;
        let ledger = cut_off(&mount, server, load, &mut Tally::default()).await?;
        drop(tracer);
        (tally.trials, tally.faults) = (trial + 1, tally.faults + 1);
        tally.audit += match site.start().await {
            Ok(server) => ledger.audit(&Caller::new(&[&server.url])).await,
            Err(_) => {
                let acknowledged =
                    ledger.sessions.iter().map(|session| session.reports.len() + session.corrections.len() + 1).sum();
                Audit { acknowledged, lost: acknowledged, doubled: 0 }
            }
        };
    }
    Ok(Some(tally))
}
