//! Lists read what they show: how large the requests behind them are does not matter.

use std::time::{Duration, Instant};

use crate::support::patience::within;
use crate::support::{App, execute, postgres, specification};
use ballast::service::config::StoreLocation;
use futures_util::future::join_all;
use serde_json::json;

const JOBS: usize = 1000;
const REQUEST_BYTES: usize = 418_000;
/// Of one list, and of `/action` while 16 lists at a time are asked for.
const LIST: Duration = Duration::from_millis(100);
const ACTION: Duration = Duration::from_millis(50);
/// The same where a database on the same machine takes the processor for eight times as many lists.
const ACTION_BESIDE_A_DATABASE: Duration = Duration::from_millis(200);
/// What the lists may add to the process, in bytes.
const MEMORY: u64 = 50 << 20;

/// The largest resident size since the last call, in bytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    // Writing 5 sets the peak back to the present size.
    std::fs::write("/proc/self/clear_refs", "5").unwrap();
    1024 * line.trim().trim_end_matches(" kB").trim().parse::<u64>().unwrap()
}

/// The one worker has enough to do with the first of them; nobody claims the rest.
const QUEUED: &str = "INSERT INTO jobs (job, tenant, kind, state, steps_total, created_ms, worker, lease_until_ms)
    SELECT 'large_' || n, 'default', 'train', 'running', 1, 1, 'nobody', 9000000000000000 FROM numbers";

#[tokio::test(flavor = "multi_thread")]
async fn a_list_of_large_jobs_is_quick_small_and_in_nobodys_way() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    for statement in [
        "CREATE TABLE numbers AS WITH RECURSIVE n (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM n WHERE n < 1000) SELECT n FROM n",
        QUEUED,
        "INSERT INTO job_requests (job, json, labels_json) SELECT job, printf('%.*c', 418000, 'x'), '' FROM jobs WHERE job LIKE 'large_%'",
    ] {
        execute(app.folder(), statement).await;
    }
    are_quick_small_and_in_nobodys_way(app, ACTION).await;

    // One after the other, for both are timed.
    let Some(url) = postgres::database().await else { return };
    let store = url.parse().unwrap();
    let mut app = App::configured(|config| config.store = StoreLocation::Postgres(store)).await;
    app.train(&specification(2)).await;
    for statement in [
        "CREATE TABLE numbers AS SELECT n FROM generate_series(1, 1000) AS n",
        QUEUED,
        "INSERT INTO job_requests (job, json, labels_json) SELECT job, repeat('x', 418000), '' FROM jobs WHERE job LIKE 'large_%'",
    ] {
        postgres::execute(&url, statement).await;
    }
    are_quick_small_and_in_nobodys_way(app, ACTION_BESIDE_A_DATABASE).await;
}

const SESSIONS: usize = 20_000;
/// Of a list of another tenant meanwhile, where each of the lists before it takes several times as long.
const OTHER_LIST: Duration = Duration::from_millis(400);

/// One tenant puts all its sessions in order, eight lists at a time; another's lists find a connection.
#[tokio::test(flavor = "multi_thread")]
async fn long_lists_of_one_tenant_are_in_nobodys_way() {
    let mut app = App::start().await;
    let (north, south) = (app.key("north", "admin").await, app.key("south", "admin").await);
    app.enter(&north).await;
    app.train(&specification(3)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    for statement in [
        "WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < 20000)
         INSERT INTO sessions (session, tenant, policy, initial_wealth, initial_holding, initial_history, history_seal,
                               horizon, plan_json, room, assets, created_ms, seal)
         SELECT printf('session_%032d', n), tenant, policy, initial_wealth, initial_holding, initial_history, history_seal,
                horizon, plan_json, room, assets, n, seal FROM numbers CROSS JOIN sessions",
        "INSERT INTO entries SELECT sessions.session, entry, kind, number, content_json, answer_json, numbers,
                entries.created_ms, access_key, entries.seal
         FROM sessions CROSS JOIN entries WHERE sessions.session LIKE 'session_0000%'",
    ] {
        execute(app.folder(), statement).await;
    }
    let all = format!("{}/sessions?sort=-wealth&count=care", app.url);
    let (page, started) = (app.get("/sessions?count=total").await, Instant::now());
    assert_eq!((page.0.as_u16(), page.1["total"].as_u64()), (200, Some(SESSIONS as u64 + 1)), "{page:?}");
    assert_eq!(app.client.get(&all).send().await.unwrap().status(), 200);
    println!("{:?} for all {SESSIONS} sessions in order", started.elapsed());
    let client = app.client.clone();
    app.enter(&south).await;
    let attack = join_all((0..8).map(|_| async {
        loop {
            client.get(&all).send().await.unwrap().bytes().await.unwrap();
        }
    }));
    let others = async {
        let mut slowest = Duration::ZERO;
        for path in ["/sessions?search=zz", "/jobs", "/policies", "/sessions"].iter().cycle().take(40) {
            let asked = Instant::now();
            assert_eq!(app.get(path).await.0, 200, "{path}");
            slowest = slowest.max(asked.elapsed());
        }
        slowest
    };
    let slowest = tokio::select! {
        _ = attack => unreachable!("it goes on until the others are done"),
        slowest = others => slowest,
    };
    println!("{slowest:?} for another tenant's");
    assert!(slowest < within(OTHER_LIST), "{slowest:?}");
}

async fn are_quick_small_and_in_nobodys_way(mut app: App, action: Duration) {
    app.open().await;
    let list = format!("{}/jobs?limit={JOBS}", app.url);
    let listed = async || app.client.get(&list).send().await.unwrap().bytes().await.unwrap().len();
    assert!(listed().await > 100 * JOBS);
    peak();
    let before = peak();
    let mut quickest = Duration::MAX;
    for _ in 0..10 {
        let started = Instant::now();
        listed().await;
        quickest = quickest.min(started.elapsed());
    }

    let (stop, stopped) = tokio::sync::watch::channel(false);
    let lists: Vec<_> = (0..16)
        .map(|_| {
            let (client, list, stopped) = (app.client.clone(), list.clone(), stopped.clone());
            tokio::spawn(async move {
                let mut count = 0;
                while !*stopped.borrow() {
                    count += usize::from(client.get(&list).send().await.unwrap().bytes().await.is_ok());
                }
                count
            })
        })
        .collect();
    let mut times = Vec::new();
    for _ in 0..300 {
        let started = Instant::now();
        assert_eq!(app.action().await.0, 200);
        times.push(started.elapsed());
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(app.get("/readyz").await.0, 200);
    stop.send_replace(true);
    let mut count = 0;
    for list in lists {
        count += list.await.unwrap();
    }
    times.sort();
    let (memory, slow) = (peak().saturating_sub(before), times[times.len() * 99 / 100]);
    println!(
        "{JOBS} jobs of {} KB: a list in {quickest:?}; {count} lists 16 at a time, /action {slow:?} at the 99th percentile, {:.1} MB more",
        REQUEST_BYTES / 1000,
        memory as f64 / 1e6
    );
    assert!(quickest < within(LIST), "{quickest:?}");
    assert!(slow < within(action), "{slow:?}");
    assert!(memory < MEMORY, "{memory} bytes");
    assert_eq!(app.post("/what-if", &json!({ "session": app.session })).await.0, 200);
}
