//! The disk fills up under load: writes are refused with 507, reads go on, and so do writes once there is room again.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::json;

use crate::caller::Caller;
use crate::load::Load;
use crate::mount::{Mount, skip};
use crate::scene::{Outcome, Tally, import};
use crate::server::{Server, Site};
use crate::support::patience::within;

const MEGABYTES: usize = 8;
const CLIENTS: usize = 4;
const PATIENCE: Duration = Duration::from_secs(10);

pub async fn full(trials: usize) -> Outcome {
    let mut tally = Tally::default();
    for trial in 0..trials {
        // A new disk each: a database only grows.
        let Some(mount) = Mount::in_memory(MEGABYTES) else { return skip("no tmpfs: mount needs root") };
        let site = Site::at(&mount.path().join("data"));
        let mut server = site.start().await?;
        tally.started(&server);
        let mut caller = Caller::new(&[&server.url]);
        let policy = import(&caller).await;
        let session = caller.open(&policy).await.ok_or("no session")?;
        let load = Load::start(&[&server.url], &policy, CLIENTS, trial as u64);
        load.acknowledges(40).await;
        let fill = fill(&mount.path());
        refuses(&caller, &session).await?;
        let ledger = if trial % 2 == 0 {
            std::fs::remove_file(fill).unwrap();
            writes(&caller, &session).await?;
            load.acknowledges(40).await;
            load.stop().await
        } else {
            server = killed_while_full(server, &site, &fill).await?;
            tally.started(&server);
            caller = Caller::new(&[&server.url]);
            writes(&caller, &session).await?;
            load.stop().await
        };
        tally.examine(&ledger, &caller, &mut 0).await;
        (tally.trials, tally.faults) = (trial + 1, tally.faults + 1);
        tally.inspect(&site).await;
        tally.listen(&site);
        drop(server);
    }
    Ok(Some(tally))
}

async fn killed_while_full(mut server: Server, site: &Site, fill: &Path) -> Result<Server, String> {
    server.signal("-KILL");
    server.ended().await.ok_or("it did not end")?;
    std::fs::remove_file(fill).unwrap();
    site.start().await
}

/// A file that takes all the room there is.
fn fill(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("fill");
    let mut file = File::create(&path).unwrap();
    for size in [1 << 16, 1 << 10, 1] {
        let block = vec![1u8; size];
        while file.write_all(&block).is_ok() {}
    }
    path
}

/// Reports are recorded until the write-ahead log is full; then they get 507, and reads are answered.
async fn refuses(caller: &Caller, session: &str) -> Result<(), String> {
    let started = Instant::now();
    for period in 1.. {
        let report = json!({ "session": session, "period": period, "log_return": 0.001 });
        match caller.post("/observe", &report).await {
            Some((507, _)) => break,
            Some((200, _)) if period < crate::scene::HORIZON - 1 && started.elapsed() < within(PATIENCE) => {}
            other => return Err(format!("on a full disk: {other:?}")),
        }
    }
    for path in [format!("/action?session={session}"), format!("/sessions/{session}/history"), "/jobs".into()] {
        let answer = caller.get(&path).await;
        if answer.as_ref().is_none_or(|(status, _)| *status != 200) {
            return Err(format!("{path} on a full disk: {answer:?}"));
        }
    }
    Ok(())
}

/// There is room again: the next report is taken.
async fn writes(caller: &Caller, session: &str) -> Result<(), String> {
    let started = Instant::now();
    loop {
        let next = caller.get(&format!("/sessions/{session}")).await.ok_or("no session")?.1["period"].clone();
        let answer = caller.post("/observe", &json!({ "session": session, "period": next, "log_return": 0.002 })).await;
        match answer {
            Some((200, _)) => return Ok(()),
            Some((503 | 507, _)) if started.elapsed() < within(PATIENCE) => {
                tokio::time::sleep(Duration::from_millis(10)).await
            }
            other => return Err(format!("with room again: {other:?}")),
        }
    }
}
