//! The store's promises, on a real file in a temporary folder.

use std::path::Path;

use ballast::control::policy::content_hash;
use ballast::store::{
    Append, CreateJob, CreateSession, DeletePolicy, JobCounts, JobKind, JobOutcome, JobRow, JobState, NewJob,
    NewObservation, NewSession, Store, StoreError,
};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{AssertSqlSafe, Connection};
use tempfile::TempDir;

const POLICY: &[u8] = br#"{"format":"test"}"#;

async fn fresh() -> (TempDir, Store) {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(&dir.path().join("data")).await.unwrap();
    (dir, store)
}

async fn reopened(dir: &TempDir, store: Store) -> Store {
    store.close().await;
    Store::open(&dir.path().join("data")).await.unwrap()
}

/// Changes the file behind a closed store's back.
async fn tamper(dir: &Path, statement: &str) {
    let options = SqliteConnectOptions::new().filename(dir.join("data/ballast.sqlite"));
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    let changed = sqlx::query(AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
    assert_eq!(changed.rows_affected(), 1, "{statement}");
    connection.close().await.unwrap();
}

fn new_job(job: &str, key: Option<&str>) -> NewJob {
    NewJob {
        job: job.into(),
        kind: JobKind::Train,
        request_json: r#"{"seed":1}"#.into(),
        request_hash: "hash".into(),
        idempotency_key: key.map(str::to_owned),
        steps_total: 10,
        created_ms: 1000,
    }
}

async fn queued(store: &Store, job: &str) -> JobRow {
    match store.create_job(new_job(job, None)).await.unwrap() {
        CreateJob::Created(row) => row,
        other => panic!("{other:?}"),
    }
}

async fn claimed(store: &Store, now_ms: i64) -> (String, i64) {
    let claimed = store.claim_job("worker", 30, now_ms).await.unwrap().expect("a job to claim");
    (claimed.row.job, claimed.attempt)
}

async fn with_session(store: &Store, session: &str, history: &[f64]) {
    let policy = content_hash(POLICY);
    store.insert_policy(&policy, POLICY, 1).await.unwrap();
    let new = NewSession {
        session: session.into(),
        policy,
        wealth: 100.0,
        history: history.into(),
        horizon: 3,
        created_ms: 5,
    };
    assert_eq!(store.create_session(new).await.unwrap(), CreateSession::Created);
}

fn observation(session: &str, period: usize, content: &str) -> NewObservation {
    NewObservation {
        session: session.into(),
        period,
        content_hash: content.into(),
        log_return: -0.0,
        executed_allocation: 0.1 + 0.2,
        advised_allocation: 1.0 / 3.0,
        wealth_after: 101.0,
        answer_json: format!(r#"{{"answer":"{content}"}}"#),
        created_ms: 7,
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[tokio::test]
async fn a_second_open_is_refused_until_the_first_closes() {
    let (dir, store) = fresh().await;
    store.ping().await.unwrap();
    let second = Store::open(&dir.path().join("data")).await;
    assert!(matches!(second, Err(StoreError::Locked { .. })));
    let store = reopened(&dir, store).await;
    store.ping().await.unwrap();
}

#[tokio::test]
async fn a_closed_store_answers_unavailable() {
    let (_dir, store) = fresh().await;
    store.close().await;
    store.close().await;
    assert!(matches!(store.ping().await, Err(StoreError::Unavailable { .. })));
    assert!(matches!(store.job("j").await, Err(StoreError::Unavailable { .. })));
    assert!(matches!(store.create_job(new_job("j", None)).await, Err(StoreError::Unavailable { .. })));
}

#[tokio::test]
async fn a_newer_schema_is_refused() {
    let (dir, store) = fresh().await;
    store.close().await;
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                 VALUES (9000, 'of a later release', 1, x'00', 0)";
    tamper(dir.path(), newer).await;
    let refused = Store::open(&dir.path().join("data")).await;
    assert!(matches!(refused, Err(StoreError::NewerSchema { found: 9000, .. })));
}

#[tokio::test]
async fn a_file_that_is_no_database_is_fatal() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("ballast.sqlite"), [b'x'; 8192]).unwrap();
    let refused = Store::open(dir.path()).await.err().expect("a refusal");
    assert!(refused.is_fatal(), "{refused:?}");
}

#[tokio::test]
async fn an_idempotency_key_makes_one_job() {
    let (dir, store) = fresh().await;
    let CreateJob::Created(first) = store.create_job(new_job("j1", Some("key"))).await.unwrap() else { panic!() };
    assert_eq!((first.state, first.attempt, first.steps_done), (JobState::Queued, 0, 0));
    let store = reopened(&dir, store).await;
    assert_eq!(store.create_job(new_job("j2", Some("key"))).await.unwrap(), CreateJob::Repeated(first.clone()));
    let other = NewJob { request_hash: "other".into(), ..new_job("j3", Some("key")) };
    assert_eq!(store.create_job(other).await.unwrap(), CreateJob::KeyConflict);
    assert_eq!(store.jobs(10, None).await.unwrap(), [first]);
}

#[tokio::test]
async fn a_refused_operation_leaves_its_neighbours_alone() {
    let (_dir, store) = fresh().await;
    queued(&store, "taken").await;
    let names: Vec<_> = (0..40).map(|n| if n % 4 == 0 { "taken".into() } else { format!("j{n}") }).collect();
    let results = futures_util::future::join_all(names.iter().map(|name| store.create_job(new_job(name, None)))).await;
    for (name, result) in names.iter().zip(results) {
        match name.as_str() {
            "taken" => assert!(matches!(result, Err(StoreError::Refused { .. }))),
            _ => assert!(matches!(result, Ok(CreateJob::Created(_)))),
        }
    }
    assert_eq!(store.count_jobs_by_state().await.unwrap(), JobCounts { queued: 31, ..JobCounts::default() });
}

#[tokio::test]
async fn jobs_are_listed_newest_first_by_cursor() {
    let (_dir, store) = fresh().await;
    for n in 0..5 {
        queued(&store, &format!("j{n}")).await;
    }
    let first = store.jobs(2, None).await.unwrap();
    let rest = store.jobs(10, Some(first[1].sequence)).await.unwrap();
    let names: Vec<_> = first.iter().chain(&rest).map(|row| row.job.as_str()).collect();
    assert_eq!(names, ["j4", "j3", "j2", "j1", "j0"]);
}

#[tokio::test]
async fn the_oldest_job_is_claimed_and_a_lease_that_ran_out_is_taken_over() {
    let (_dir, store) = fresh().await;
    queued(&store, "j1").await;
    queued(&store, "j2").await;
    assert_eq!(claimed(&store, 0).await, ("j1".into(), 1));
    assert_eq!(claimed(&store, 0).await, ("j2".into(), 1));
    assert!(store.renew_lease("j1", 1, 60_000).await.unwrap());
    assert_eq!(claimed(&store, 30_000).await, ("j2".into(), 2));
    assert_eq!(store.claim_job("worker", 30, 30_000).await.unwrap(), None);
    assert_eq!(store.job("j2").await.unwrap().unwrap().started_ms, Some(0));
}

#[tokio::test]
async fn a_worker_that_lost_its_lease_is_fenced_everywhere() {
    let (_dir, store) = fresh().await;
    queued(&store, "j").await;
    let (_, stale) = claimed(&store, 0).await;
    assert!(store.save_checkpoint("j", stale, 9, b"nine").await.unwrap());
    let (_, current) = claimed(&store, 40_000).await;
    assert!(!store.renew_lease("j", stale, 90_000).await.unwrap());
    assert!(!store.save_checkpoint("j", stale, 8, b"stale").await.unwrap());
    assert!(!store.release_job("j", stale, 41_000).await.unwrap());
    assert!(!store.finish_job("j", stale, JobOutcome::Cancelled, 41_000).await.unwrap());
    assert_eq!(store.checkpoints("j").await.unwrap(), [(9, b"nine".to_vec())]);
    assert!(store.save_checkpoint("j", current, 8, b"eight").await.unwrap());
    assert_eq!(store.job("j").await.unwrap().unwrap().steps_done, 2);
}

#[tokio::test]
async fn a_finished_training_stores_its_policy_and_drops_its_checkpoints() {
    let (dir, store) = fresh().await;
    queued(&store, "j").await;
    let (_, attempt) = claimed(&store, 1).await;
    assert!(store.save_checkpoint("j", attempt, 9, b"nine").await.unwrap());
    let policy_id = content_hash(POLICY);
    let outcome = JobOutcome::Succeeded { policy_id: policy_id.clone(), policy_json: POLICY.into() };
    assert!(store.finish_job("j", attempt, outcome.clone(), 77).await.unwrap());
    assert!(!store.finish_job("j", attempt, outcome, 78).await.unwrap());
    let store = reopened(&dir, store).await;
    let row = store.job("j").await.unwrap().unwrap();
    assert_eq!((row.state, row.steps_done, row.finished_ms), (JobState::Succeeded, 10, Some(77)));
    assert_eq!(row.policy, Some(policy_id.clone()));
    assert_eq!(store.policy(&policy_id).await.unwrap().unwrap().json, POLICY);
    assert_eq!(store.checkpoints("j").await.unwrap(), []);
    assert_eq!(store.request_cancel("j", 99).await.unwrap().unwrap(), row);
}

#[tokio::test]
async fn failures_and_reports_end_a_job() {
    let (_dir, store) = fresh().await;
    queued(&store, "fails").await;
    queued(&store, "reports").await;
    let (_, attempt) = claimed(&store, 1).await;
    assert!(store.finish_job("fails", attempt, JobOutcome::Failed { reason: "singular".into() }, 2).await.unwrap());
    let (_, attempt) = claimed(&store, 3).await;
    let report = JobOutcome::Reported { report_json: "{}".into() };
    assert!(store.finish_job("reports", attempt, report, 4).await.unwrap());
    assert_eq!(store.job("fails").await.unwrap().unwrap().error.as_deref(), Some("singular"));
    assert_eq!(store.job("reports").await.unwrap().unwrap().report_json.as_deref(), Some("{}"));
    let counts = store.count_jobs_by_state().await.unwrap();
    assert_eq!(counts, JobCounts { failed: 1, succeeded: 1, ..JobCounts::default() });
}

#[tokio::test]
async fn cancelling_ends_a_queued_job_and_flags_a_running_one() {
    let (_dir, store) = fresh().await;
    assert_eq!(store.request_cancel("nobody", 1).await.unwrap(), None);
    queued(&store, "waits").await;
    let row = store.request_cancel("waits", 5).await.unwrap().unwrap();
    assert_eq!((row.state, row.finished_ms), (JobState::Cancelled, Some(5)));
    queued(&store, "runs").await;
    let (_, attempt) = claimed(&store, 6).await;
    let row = store.request_cancel("runs", 7).await.unwrap().unwrap();
    assert_eq!((row.state, row.cancel_requested), (JobState::Running, true));
    assert!(store.finish_job("runs", attempt, JobOutcome::Cancelled, 8).await.unwrap());
    assert_eq!(store.job("runs").await.unwrap().unwrap().state, JobState::Cancelled);
}

#[tokio::test]
async fn a_job_asked_to_stop_is_not_claimed_again() {
    let (_dir, store) = fresh().await;
    for job in ["abandoned", "released"] {
        queued(&store, job).await;
        let (_, attempt) = claimed(&store, 0).await;
        store.request_cancel(job, 1).await.unwrap();
        if job == "released" {
            assert!(store.release_job(job, attempt, 2).await.unwrap());
        }
    }
    assert_eq!(store.claim_job("worker", 30, 50_000).await.unwrap(), None);
    let counts = store.count_jobs_by_state().await.unwrap();
    assert_eq!(counts, JobCounts { cancelled: 2, ..JobCounts::default() });
}

#[tokio::test]
async fn opening_the_folder_ends_the_leases_of_the_dead() {
    let (dir, store) = fresh().await;
    queued(&store, "j").await;
    let (_, dead) = claimed(&store, 0).await;
    assert_eq!(store.claim_job("worker", 30, 1).await.unwrap(), None);
    let store = reopened(&dir, store).await;
    assert_eq!(claimed(&store, 1).await, ("j".into(), dead + 1));
    assert!(!store.save_checkpoint("j", dead, 9, b"late").await.unwrap());
}

#[tokio::test]
async fn a_released_job_resumes_from_its_checkpoints() {
    let (dir, store) = fresh().await;
    queued(&store, "j").await;
    let (_, attempt) = claimed(&store, 0).await;
    for step in [9, 8] {
        assert!(store.save_checkpoint("j", attempt, step, &[step as u8; 100]).await.unwrap());
    }
    assert!(store.release_job("j", attempt, 1).await.unwrap());
    let store = reopened(&dir, store).await;
    let (_, attempt) = claimed(&store, 2).await;
    assert_eq!(attempt, 2);
    assert_eq!(store.checkpoints("j").await.unwrap(), [(8, vec![8; 100]), (9, vec![9; 100])]);
    store.close().await;
    tamper(dir.path(), "UPDATE checkpoints SET bytes = x'00' WHERE step = 8").await;
    let store = Store::open(&dir.path().join("data")).await.unwrap();
    assert!(matches!(store.checkpoints("j").await, Err(StoreError::Corrupt { .. })));
}

#[tokio::test]
async fn a_policy_is_stored_once_listed_and_kept_while_in_use() {
    let (_dir, store) = fresh().await;
    let policy = content_hash(POLICY);
    assert!(matches!(store.insert_policy("other", POLICY, 1).await, Err(StoreError::Corrupt { .. })));
    assert!(store.insert_policy(&policy, POLICY, 1).await.unwrap());
    assert!(!store.insert_policy(&policy, POLICY, 2).await.unwrap());
    let listed = store.policies(10, None).await.unwrap();
    assert_eq!((listed.len(), listed[0].created_ms, listed[0].bytes), (1, 1, POLICY.len() as u64));
    assert_eq!(store.policies(10, Some(listed[0].sequence)).await.unwrap(), []);
    with_session(&store, "s", &[0.1, 0.2]).await;
    assert_eq!(store.delete_policy(&policy).await.unwrap(), DeletePolicy::InUse { sessions: 1 });
    assert!(store.delete_session("s").await.unwrap());
    assert_eq!(store.delete_policy(&policy).await.unwrap(), DeletePolicy::Deleted);
    assert_eq!(store.delete_policy(&policy).await.unwrap(), DeletePolicy::Absent);
    assert_eq!(store.policy(&policy).await.unwrap(), None);
}

#[tokio::test]
async fn a_damaged_policy_is_detected() {
    let (dir, store) = fresh().await;
    let policy = content_hash(POLICY);
    store.insert_policy(&policy, POLICY, 1).await.unwrap();
    store.close().await;
    tamper(dir.path(), "UPDATE policies SET json = x'7b7d'").await;
    let store = Store::open(&dir.path().join("data")).await.unwrap();
    assert!(matches!(store.policy(&policy).await, Err(StoreError::Corrupt { .. })));
    store.ping().await.unwrap();
}

#[tokio::test]
async fn a_session_needs_its_policy_and_a_free_name() {
    let (_dir, store) = fresh().await;
    let new = NewSession {
        session: "s".into(),
        policy: "none".into(),
        wealth: 1.0,
        history: vec![],
        horizon: 1,
        created_ms: 1,
    };
    assert_eq!(store.create_session(new.clone()).await.unwrap(), CreateSession::NoPolicy);
    with_session(&store, "s", &[0.1, 0.2]).await;
    let again = NewSession { policy: content_hash(POLICY), ..new };
    assert_eq!(store.create_session(again).await.unwrap(), CreateSession::Exists);
    assert_eq!(store.session("s").await.unwrap().unwrap().initial_wealth, 100.0);
    assert_eq!(store.session("nobody").await.unwrap(), None);
    assert!(!store.delete_session("nobody").await.unwrap());
    assert_eq!(store.count_sessions().await.unwrap(), 1);
}

#[tokio::test]
async fn a_restart_keeps_sessions_bit_for_bit() {
    let (dir, store) = fresh().await;
    let history = [0.1, -0.0, 5e-324, -1.0 / 3.0, f64::MAX];
    with_session(&store, "s", &history).await;
    for period in 1..=3 {
        let appended = store.append_observation(observation("s", period, "c")).await.unwrap();
        assert_eq!(appended, Append::Appended);
    }
    let store = reopened(&dir, store).await;
    let row = store.session("s").await.unwrap().unwrap();
    assert_eq!(bits(&row.initial_history), bits(&history));
    let read = store.observations("s").await.unwrap();
    assert_eq!(read.iter().map(|row| row.period).collect::<Vec<_>>(), [1, 2, 3]);
    let (wrote, read) = (observation("s", 2, "c"), &read[1]);
    assert_eq!(
        bits(&[read.log_return, read.executed_allocation, read.advised_allocation, read.wealth_after]),
        bits(&[wrote.log_return, wrote.executed_allocation, wrote.advised_allocation, wrote.wealth_after])
    );
    assert_eq!(store.observation("s", 2).await.unwrap().as_ref(), Some(read));
    assert_eq!(store.sessions(10, None).await.unwrap()[0].observations, 3);
}

#[tokio::test]
async fn every_observation_is_stored_once_and_in_order() {
    let (_dir, store) = fresh().await;
    assert_eq!(store.append_observation(observation("s", 1, "a")).await.unwrap(), Append::NoSession);
    with_session(&store, "s", &[0.1, 0.2]).await;
    let append = async |period, content| store.append_observation(observation("s", period, content)).await.unwrap();
    assert_eq!(append(2, "a").await, Append::OutOfOrder { expected: 1 });
    assert_eq!(append(0, "a").await, Append::OutOfOrder { expected: 1 });
    assert_eq!(append(1, "a").await, Append::Appended);
    assert_eq!(append(1, "a").await, Append::Repeated { answer_json: r#"{"answer":"a"}"#.into() });
    assert_eq!(append(1, "b").await, Append::Conflict);
    assert_eq!(append(3, "a").await, Append::OutOfOrder { expected: 2 });
    assert!(store.delete_session("s").await.unwrap());
    assert_eq!(store.observations("s").await.unwrap(), []);
}

#[tokio::test(flavor = "multi_thread")]
async fn sixteen_reports_of_one_period_have_one_winner() {
    let (_dir, store) = fresh().await;
    with_session(&store, "s", &[0.1, 0.2]).await;
    let tasks: Vec<_> = (0..16)
        .map(|client| {
            let store = store.clone();
            tokio::spawn(async move { store.append_observation(observation("s", 1, &format!("c{client}"))).await })
        })
        .collect();
    let mut winners = 0;
    for task in tasks {
        match task.await.unwrap().unwrap() {
            Append::Appended => winners += 1,
            other => assert_eq!(other, Append::Conflict),
        }
    }
    assert_eq!(winners, 1);
    assert_eq!(store.observations("s").await.unwrap().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn many_sessions_commit_in_groups() {
    let (dir, store) = fresh().await;
    for session in 0..50 {
        with_session(&store, &format!("s{session}"), &[0.1, 0.2]).await;
    }
    for period in 1..=4 {
        let appends = (0..50).map(|session| {
            let store = store.clone();
            async move { store.append_observation(observation(&format!("s{session}"), period, "c")).await }
        });
        let appends = futures_util::future::join_all(appends.map(tokio::spawn)).await;
        assert!(appends.into_iter().all(|append| append.unwrap().unwrap() == Append::Appended));
    }
    let store = reopened(&dir, store).await;
    let listed = store.sessions(100, None).await.unwrap();
    assert_eq!(listed.len(), 50);
    assert!(listed.iter().all(|session| session.observations == 4));
}

#[tokio::test]
async fn damage_to_what_an_action_rests_on_is_detected() {
    let damages = [
        "UPDATE sessions SET initial_history = x'000000000000f03f000000000000f03f'",
        "UPDATE sessions SET initial_history = x'00'",
        "UPDATE sessions SET initial_wealth = 1e6",
        "UPDATE observations SET log_return = 0.0 WHERE period = 2",
        "UPDATE observations SET answer_json = '{}' WHERE period = 1",
        "DELETE FROM observations WHERE period = 1",
    ];
    for damage in damages {
        let (dir, store) = fresh().await;
        with_session(&store, "s", &[0.1, 0.2]).await;
        for period in 1..=2 {
            store.append_observation(observation("s", period, "c")).await.unwrap();
        }
        store.close().await;
        tamper(dir.path(), damage).await;
        let store = Store::open(&dir.path().join("data")).await.unwrap();
        let damaged = match damage.contains("sessions") {
            true => store.session("s").await.err(),
            false => store.observations("s").await.err(),
        };
        assert!(matches!(damaged, Some(StoreError::Corrupt { .. })), "{damage}: {damaged:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn reads_run_on_any_thread() {
    let (_dir, store) = fresh().await;
    with_session(&store, "s", &[0.1, 0.2]).await;
    let read = tokio::spawn(async move {
        store.ping().await?;
        store.checkpoints("j").await?;
        store.count_jobs_by_state().await?;
        store.policy(&content_hash(POLICY)).await?;
        store.policies(1, None).await?;
        store.jobs(1, None).await?;
        store.observations("s").await?;
        store.sessions(1, None).await?;
        store.session("s").await
    });
    assert_eq!(read.await.unwrap().unwrap().unwrap().session, "s");
}
