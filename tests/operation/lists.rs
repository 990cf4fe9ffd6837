//! Lists read only what they show: the size of the requests behind them does not matter.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use crate::support::patience::within;
use crate::support::{App, execute, postgres, specification};
use ballast::service::process::config::StoreLocation;
use ballast::store::{Append, CreateSession, EntryRow, Relabel, SessionFacts, SessionRow, Store};
use futures_util::future::join_all;
use futures_util::stream::{self, StreamExt};
use serde_json::json;
use tokio::sync::Mutex;

const JOBS: usize = 1000;
const REQUEST_BYTES: usize = 418_000;
/// The time limits of one list, and of `/action` while 16 lists at a time are requested.
const LIST: Duration = Duration::from_millis(100);
const ACTION: Duration = Duration::from_millis(50);
/// The limit of `/action` while a database on the same machine uses the processor for eight times as many lists.
const ACTION_BESIDE_A_DATABASE: Duration = Duration::from_millis(200);
/// Bytes that the lists may add to the process.
const MEMORY: u64 = 50 << 20;

/// Returns the largest resident size since the last call, in bytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    // Writing 5 resets the peak to the present size.
    std::fs::write("/proc/self/clear_refs", "5").unwrap();
    1024 * line.trim().trim_end_matches(" kB").trim().parse::<u64>().unwrap()
}

/// These jobs are marked as running with a lease far in the future, so no worker claims them.
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

    // One after the other, because both are timed.
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

/// Sessions of one tenant beside the one that is opened over HTTP. `BALLAST_LISTED_SESSIONS` sets another number, as for
/// the table of `docs/capacity.md`; a tenant's quota allows 999,999.
const SESSIONS: usize = 20_000;
/// The time limit of a list and of a search in the order of opening.
const PAGE: Duration = Duration::from_millis(100);
/// That limit while a database without statistics of its rows also uses the processor.
const PAGE_BESIDE_A_DATABASE: Duration = Duration::from_millis(400);
/// The time limit of another tenant's list while eight lists at a time read all the sessions.
const OTHER_LIST: Duration = Duration::from_millis(400);
/// Sessions that are opened at the same time. More wait too long for a connection beside other tests.
const AT_ONCE: usize = 12;

fn sessions() -> usize {
    std::env::var("BALLAST_LISTED_SESSIONS").map_or(SESSIONS, |count| count.parse().expect("a number"))
}

/// Sessions of another tenant, whose list is timed.
const OTHERS: usize = 50;

/// Opens `count` sessions like `first`, each with a number in its name; those of the first eighth have a tag.
async fn open_many(store: &Store, first: SessionFacts, count: usize) {
    let opened = stream::iter(1..=count).map(|number| {
        let session =
            format!("session_{:032x}", (number as u128).wrapping_mul(0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835));
        let row = SessionRow { session: session.clone(), created_ms: number as i64, ..first.row.clone() };
        let tags = if number <= count / 8 { vec!["Legacy".to_owned()] } else { Vec::new() };
        let labels = Relabel { name: Some(format!("Fund {number}")), tags: Some(tags), ..Relabel::default() };
        let entry = EntryRow { session, ..first.entries[0].clone() };
        async move {
            assert_eq!(store.create_session(row, labels, None).await.unwrap(), CreateSession::Created);
            assert_eq!(store.append(entry).await.unwrap(), Append::Appended);
        }
    });
    opened.buffer_unordered(AT_ONCE).for_each(async |()| {}).await;
}

/// Returns the median and the slowest of `times` answers, and how many sessions the last one lists.
async fn timed(app: &App, path: &str, times: usize) -> (Duration, Duration, usize) {
    let (mut durations, mut listed) = (Vec::new(), 0);
    for _ in 0..times {
        let started = Instant::now();
        let (status, page) = app.get(path).await;
        durations.push(started.elapsed());
        assert_eq!((status.as_u16(), &page["damaged"]), (200, &json!([])), "{path}");
        listed = page["sessions"].as_array().unwrap().len();
    }
    durations.sort();
    (durations[times / 2], durations[times - 1], listed)
}

/// Holds one of the two tests below back while the other is timed.
static TIMED: Mutex<()> = Mutex::const_new(());

#[tokio::test(flavor = "multi_thread")]
async fn lists_and_searches_of_many_sessions_in_a_folder_are_quick_and_in_nobodys_way() {
    let _timed = TIMED.lock().await;
    are_listed_quickly_and_in_nobodys_way(App::start().await, PAGE).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_and_searches_of_many_sessions_in_a_database_are_quick_and_in_nobodys_way() {
    let _timed = TIMED.lock().await;
    if let Some(app) = App::over_a_database().await {
        are_listed_quickly_and_in_nobodys_way(app, PAGE_BESIDE_A_DATABASE).await;
    }
}

/// One tenant lists, searches and sorts many sessions while another's lists still find a connection.
async fn are_listed_quickly_and_in_nobodys_way(mut app: App, page: Duration) {
    let count = sessions();
    let (north, south) = (app.key("north", "admin").await, app.key("south", "admin").await);
    app.enter(&south).await;
    app.train(&specification(3)).await;
    for _ in 0..OTHERS {
        app.open().await;
    }
    app.hold(&north);
    app.train(&specification(3)).await;
    app.open_with(json!({ "name": "Growth" })).await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let (session, started) = (app.session.clone(), Instant::now());
    app.between(async |store| {
        let first = store.session_facts(&"north".parse().unwrap(), &session).await.unwrap().unwrap();
        open_many(store, first, count).await;
    })
    .await;
    println!("{count} sessions opened in {:?}", started.elapsed());
    app.enter(&north).await;
    // The searches match no session, one, about one in nine, the oldest eighth, and all.
    let last = format!("fund {count}");
    for (search, listed) in
        [("", 50), ("?search=zz", 0), (&last, 1), ("fund 1", 50), ("legacy", 50), ("FUND", 50), ("growth", 1)]
    {
        let path =
            if search.is_empty() || search.starts_with('?') { search.into() } else { format!("?search={search}") };
        let (median, slowest, found) = timed(&app, &format!("/sessions{path}"), 11).await;
        println!("GET /sessions{path}: median {median:?}, slowest {slowest:?}, {found} listed");
        assert_eq!(found, listed, "{path}");
        assert!(median < within(page), "{path}: {median:?}");
    }
    let (mut after, mut found) = (String::new(), BTreeSet::new());
    while found.len() < 3_000.min(count / 8) {
        let page = app.get(&format!("/sessions?search=legacy&limit=1000{after}")).await.1;
        let rows = page["sessions"].as_array().unwrap();
        assert!(rows.iter().all(|row| found.insert(row["session"].to_string())), "each is listed once");
        after = page["next"].as_str().map_or(String::new(), |next| format!("&after={next}"));
        assert!(!rows.is_empty() && !after.is_empty() || found.len() == count / 8, "{} of them", found.len());
    }
    let total = app.get("/sessions?count=total").await.1["total"].as_u64();
    assert_eq!(total, Some(count as u64 + 1));
    let (all, client) = (format!("{}/sessions?sort=-wealth&count=care", app.url), app.client.clone());
    app.hold(&south);
    let paths = ["/sessions", "/sessions?search=zz"];
    let mut idle = Vec::new();
    for path in paths {
        idle.push(timed(&app, path, 21).await.0);
    }
    let attack = join_all((0..8).map(|_| async {
        loop {
            client.get(&all).send().await.unwrap().bytes().await.unwrap();
        }
    }));
    let others = async {
        // Until the lists are reading.
        tokio::time::sleep(Duration::from_millis(300)).await;
        for (path, idle) in paths.iter().zip(idle) {
            let (median, slowest, _) = timed(&app, path, 101).await;
            println!("another tenant's {path}: {idle:?} idle, now median {median:?}, slowest {slowest:?}");
            assert!(slowest < within(OTHER_LIST), "{slowest:?}");
        }
        for path in ["/jobs", "/policies"] {
            assert_eq!(app.get(path).await.0, 200, "{path}");
        }
    };
    tokio::select! {
        _ = attack => unreachable!("it goes on until the others are done"),
        () = others => {},
    }
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
