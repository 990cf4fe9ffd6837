//! Tenants take turns: whatever the others queue, a job at the head of its tenant's queue waits for one claim of each.

use std::time::{Duration, Instant};

use crate::support::place::Place;
use crate::support::random;
use ballast::store::{CreateJob, JobKind, JobOutcome, NewJob, Relabel, Store, Tenant};
use proptest::prelude::*;
use sqlx::AssertSqlSafe;
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

const CASES: u32 = 24;
const TENANTS: usize = 5;

/// Events before and between claims.
#[derive(Debug, Clone)]
enum Event {
    /// A tenant queues so many jobs.
    Queue(usize, usize),
    /// A worker takes a job, and keeps it.
    Claim,
    /// A worker gives a job back.
    Release,
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        3 => (1..TENANTS, 1..4usize).prop_map(|(tenant, jobs)| Event::Queue(tenant, jobs)),
        3 => Just(Event::Claim),
        1 => Just(Event::Release),
    ]
}

fn tenant(number: usize) -> Tenant {
    format!("tenant_{number}").parse().unwrap()
}

async fn queue(store: &Store, job: String, owner: usize) {
    let new = NewJob {
        job,
        tenant: tenant(owner),
        kind: JobKind::Train,
        request_json: "{}".into(),
        request_hash: "hash".into(),
        idempotency_key: None,
        labels: Relabel::default(),
        steps_total: 1,
        created_ms: 0,
    };
    assert!(matches!(store.create_job(new).await.unwrap(), CreateJob::Created(_)));
}

/// Runs the events, lets tenant 0 queue one job in their midst, and counts the claims that come before its own.
async fn waits(place: &Place, before: &[Event], after: &[Event]) -> usize {
    let store = place.open().await;
    let (mut jobs, mut held) = (0, Vec::new());
    let mut happen = async |event: &Event| match *event {
        Event::Queue(owner, count) => {
            for _ in 0..count {
                jobs += 1;
                queue(&store, format!("job_{jobs}"), owner).await;
            }
            None
        }
        Event::Claim => {
            let claimed = store.claim_job("worker", 30, 0).await.unwrap()?;
            held.push((claimed.row.job.clone(), claimed.attempt));
            Some(claimed.row.job)
        }
        Event::Release => {
            let (job, attempt) = held.pop()?;
            assert!(store.release_job(&job, attempt, 0).await.unwrap());
            None
        }
    };
    for event in before {
        happen(event).await;
    }
    queue(&store, "single".into(), 0).await;
    let mut waited = 0;
    for event in after.iter().chain(std::iter::repeat(&Event::Claim)) {
        match happen(event).await {
            Some(job) if job == "single" => break,
            Some(_) => waited += 1,
            None => {}
        }
    }
    store.close().await;
    waited
}

const TABLES: &str = "jobs, job_requests, turns, usage, idempotency_keys, checkpoints, job_reports";

/// Events before a job is queued, and after.
fn events() -> impl Strategy<Value = (Vec<Event>, Vec<Event>)> {
    let events = || proptest::collection::vec(event(), 0..30);
    (events(), events())
}

async fn waits_its_turn(place: &Place, (before, after): &(Vec<Event>, Vec<Event>)) -> Result<(), TestCaseError> {
    let waited = waits(place, before, after).await;
    prop_assert!(waited < TENANTS, "{waited} claims of {} others came first", TENANTS - 1);
    Ok(())
}

#[test]
fn a_job_waits_for_one_claim_of_each_other_tenant_over_a_folder() {
    random::over_folders(CASES, &events(), waits_its_turn);
}

#[test]
fn a_job_waits_for_one_claim_of_each_other_tenant_over_a_database() {
    random::over_a_database(TABLES, CASES, &events(), waits_its_turn);
}

/// Jobs queued by one tenant, behind the store's back.
const MANY: usize = 100_000;

fn many(numbers: &str) -> [String; 3] {
    let name = "'many_' || n";
    [
        format!(
            "INSERT INTO jobs (job, tenant, kind, state, steps_total, created_ms)
             {numbers} SELECT {name}, 'tenant_1', 'train', 'queued', 1, 0 FROM numbers"
        ),
        format!("INSERT INTO job_requests (job, json, labels_json) {numbers} SELECT {name}, '{{}}', '' FROM numbers"),
        "INSERT INTO turns (tenant, turn) VALUES ('tenant_1', 0)".to_owned(),
    ]
}

/// Claims jobs of two tenants in turn, [`MANY`] of one, and returns the seconds of the fastest claim: what else the machine
/// does, does not slow down all of them.
async fn fastest_claim(place: &Place) -> f64 {
    const CLAIMS: usize = 40;
    let store = place.open().await;
    for job in 0..CLAIMS / 2 {
        queue(&store, format!("job_{job}"), 0).await;
    }
    let (mut own, mut fastest) = (0, Duration::MAX);
    for _ in 0..CLAIMS {
        let started = Instant::now();
        let claimed = store.claim_job("worker", 30, 0).await.unwrap().unwrap();
        own += usize::from(claimed.row.tenant == tenant(0));
        let outcome = JobOutcome::Failed { reason: "enough".into() };
        assert!(store.finish_job(&claimed.row.job, claimed.attempt, outcome, 1).await.unwrap());
        fastest = fastest.min(started.elapsed());
    }
    assert_eq!(own, CLAIMS / 2, "every other claim");
    fastest.as_secs_f64()
}

/// The queue's length must not show: a claim that reads the queue takes a hundred times this.
const LONGEST: f64 = 0.02;

#[tokio::test]
async fn a_claim_costs_little_however_much_is_queued_over_a_folder() {
    let place = Place::folder();
    place.open().await.close().await;
    let Place::Folder(folder) = &place else { unreachable!() };
    let options = SqliteConnectOptions::new().filename(folder.path().join("data/ballast.sqlite"));
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    let numbers =
        format!("WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < {MANY})");
    for statement in many(&numbers) {
        sqlx::query(AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
    let seconds = fastest_claim(&place).await;
    println!("{:.2} ms to claim and end one of {MANY} jobs over a folder", 1000.0 * seconds);
    assert!(seconds < LONGEST, "{seconds} s");
}

#[tokio::test]
async fn a_claim_costs_little_however_much_is_queued_over_a_database() {
    let Some(place) = Place::database().await else { return };
    place.open().await.close().await;
    let Place::Database(url) = &place else { unreachable!() };
    for statement in many(&format!("WITH numbers (n) AS (SELECT generate_series(1, {MANY}))")) {
        crate::support::postgres::execute(url, &statement).await;
    }
    let seconds = fastest_claim(&place).await;
    println!("{:.2} ms to claim and end one of {MANY} jobs over a database", 1000.0 * seconds);
    assert!(seconds < LONGEST, "{seconds} s");
}
