//! The database or its lock is moved away, removed or replaced under a load: the server ends before it acknowledges what is
//! not there afterwards.

use std::path::Path;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::caller::Caller;
use crate::load::Load;
use crate::scene::{Outcome, Tally, import};
use crate::server::Site;
use crate::support::patience::within;

const CLIENTS: usize = 4;
/// After the change; what the reports in flight take is part of it.
const ENDS: Duration = Duration::from_secs(2);
const STORE_FAILED: i32 = 74;

pub async fn moved(trials: usize) -> Outcome {
    let (site, mut tally, mut keys) = (Site::new(), Tally::default(), 0);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let mut server = site.start().await?;
    let policy = import(&Caller::new(&[&server.url])).await;
    for trial in 0..trials {
        let load = Load::start(&[&server.url], &policy, CLIENTS, trial as u64);
        load.acknowledges(random.random_range(1..100)).await;
        let name = ["ballast.sqlite", "ballast.lock"][trial / 3 % 2];
        let file = site.data().join(name);
        let kept = file.with_extension("moved");
        match trial % 3 {
            0 => std::fs::rename(&file, &kept),
            // Its bytes have another name still.
            1 => std::fs::hard_link(&file, &kept).and_then(|()| std::fs::remove_file(&file)),
            _ => std::fs::rename(&file, &kept).and_then(|()| replace(&kept, &file)),
        }
        .map_err(|error| error.to_string())?;
        let changed = Instant::now();
        let status = server.ended().await.ok_or("it went on without its file")?;
        if changed.elapsed() > within(ENDS) || status.code() != Some(STORE_FAILED) {
            tally.complain(format!("{name}: ended with {status} after {} ms", changed.elapsed().as_millis()));
        }
        let mut ledger = load.stop().await;
        // Who asks before it has ended is told that the file is another.
        ledger.complaints.retain(|complaint| !complaint.contains(": 500 "));
        std::fs::rename(&kept, &file).map_err(|error| error.to_string())?;
        server = site.start().await?;
        tally.recovered(&server, &ledger, &mut keys).await;
    }
    tally.inspect(&site).await;
    tally.listen(&site);
    Ok(Some(tally))
}

/// Another file with its bytes.
fn replace(kept: &Path, file: &Path) -> std::io::Result<()> {
    std::fs::copy(kept, file).map(drop)
}
