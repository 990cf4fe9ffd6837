//! A service whose clock is wrong says so and deletes nothing by age, over either store.

use std::time::Duration;

use crate::support::place::Place;
use ballast::service::Service;
use ballast::service::process::clock::Clock;
use ballast::service::process::config::{Config, StoreLocation};
use ballast::service::process::shutdown::Shutdown;
use ballast::store::{Actor, AuditFilter, CreateJob, JobKind, NewJob, Relabel, Store, Tenant};

const DAY_MS: i64 = 24 * 60 * 60 * 1000;
/// In it the loops that delete by age make their first round.
const ROUND: Duration = Duration::from_secs(1);

/// A job that ended just now and an entry of the audit of it; their numbers.
async fn leave(store: &Store) {
    let now_ms = Clock::system().now_milliseconds();
    let store = store.by(Actor { key: "key_1".into(), roles: "train".into(), at_ms: now_ms });
    let new = NewJob {
        job: "job_1".into(),
        tenant: Tenant::default(),
        kind: JobKind::Train,
        request_json: "{}".into(),
        request_hash: "hash".into(),
        idempotency_key: None,
        steps_total: 1,
        created_ms: now_ms,
        labels: Relabel::default(),
    };
    assert!(matches!(store.create_job(new).await.unwrap(), CreateJob::Created(_)));
    store.request_cancel("job_1", now_ms).await.unwrap();
}

async fn kept(store: &Store) -> (usize, usize) {
    let jobs = store.jobs(&Tenant::default(), 10, None).await.unwrap().len();
    (jobs, store.deeds(&AuditFilter::default(), 10, None).await.unwrap().len())
}

/// Serves the place by a clock that is so far ahead, for a round; what it says of that.
async fn served(place: &Place, ahead_ms: i64) -> i64 {
    let store = match place {
        Place::Folder(folder) => StoreLocation::Folder(folder.path().join("data")),
        Place::Database(url) => StoreLocation::Postgres(url.parse().unwrap()),
    };
    let config = Config { store, ..Config::new("") };
    let clock = Clock::new(move || Clock::system().now_milliseconds() + ahead_ms);
    let shutdown = Shutdown::new();
    let service = Service::start(&config, clock, shutdown.clone()).await.unwrap();
    tokio::time::sleep(ROUND).await;
    let skew_seconds = service.clock_skew_seconds();
    shutdown.begin();
    service.close().await;
    skew_seconds
}

async fn a_wrong_clock_deletes_nothing(place: &Place) {
    let store = place.open().await;
    leave(&store).await;
    store.close().await;
    assert_eq!(served(place, 0).await, 0);
    let store = place.open().await;
    let before = kept(&store).await;
    assert_eq!(before, (1, 2));
    store.close().await;
    for days in [500, -500] {
        let skew_seconds = served(place, days * DAY_MS).await;
        assert!((skew_seconds - days * DAY_MS / 1000).abs() < 600, "{skew_seconds} seconds");
        let store = place.open().await;
        assert_eq!(kept(&store).await, before, "{days} days ahead");
        store.close().await;
    }
    // Soon after, by a right clock, everything is as it was.
    assert_eq!(served(place, 0).await, 0);
}

on_both_engines!(a_wrong_clock_deletes_nothing);
