//! The store's promises, each on both engines: SQLite on a real file, PostgreSQL on a real server.

use std::time::Duration;

use crate::support::place::Place;
use ballast::control::policy::content_hash;
use ballast::store::{
    Append, AuditFilter, AuditRow, CreateJob, CreateSession, DeletePolicy, EntryKind, EntryRow, InitialAccount,
    JobCounts, JobKind, JobOutcome, JobRow, JobState, NewJob, NewKey, Relabel, RequestKey, Rotation, RowVersion,
    SessionQuery, SessionRow, Store, StoreError, StoredKeys, Successor, Tenant,
};
use futures_util::future::join_all;

const POLICY: &[u8] = br#"{"format":"test"}"#;

on_both_engines!(
    a_closed_store_answers_unavailable,
    a_newer_schema_is_refused,
    an_idempotency_key_makes_one_job,
    an_idempotency_key_opens_one_session,
    a_refused_operation_leaves_its_neighbours_alone,
    jobs_are_listed_newest_first_by_cursor,
    the_oldest_job_is_claimed_and_a_lease_that_ran_out_is_taken_over,
    a_worker_that_lost_its_lease_is_fenced_everywhere,
    a_finished_training_stores_its_policy_and_drops_its_checkpoints,
    failures_and_reports_end_a_job,
    cancelling_ends_a_queued_job_and_flags_a_running_one,
    a_job_asked_to_stop_is_not_claimed_again,
    a_job_under_which_three_workers_died_fails,
    a_released_job_resumes_from_its_checkpoints,
    a_policy_is_stored_once_listed_and_kept_while_in_use,
    a_damaged_policy_is_detected,
    tenants_see_only_their_own,
    a_key_is_listed_and_revoked_beside_the_store,
    a_session_moved_to_another_tenant_is_damaged,
    a_session_needs_its_policy_and_a_free_name,
    a_restart_keeps_sessions_bit_for_bit,
    what_was_seen_is_current_until_somebody_writes,
    every_entry_is_stored_once_and_in_order,
    sixteen_reports_of_each_period_have_one_winner,
    many_sessions_commit_in_groups,
    damage_to_what_an_action_rests_on_is_detected,
    reads_run_on_any_thread,
    two_replicas_meet,
    a_head_follows_the_rows,
    a_name_nobody_can_have_finds_nothing,
);

/// So many sessions, the newest first.
fn newest(limit: usize) -> SessionQuery {
    SessionQuery { limit, descending: true, ..SessionQuery::default() }
}

fn new_job(job: &str, key: Option<&str>) -> NewJob {
    NewJob {
        job: job.into(),
        tenant: Tenant::default(),
        kind: JobKind::Train,
        request_json: r#"{"seed":1}"#.into(),
        request_hash: "hash".into(),
        idempotency_key: key.map(str::to_owned),
        labels: Relabel::default(),
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

/// Opens a session, and gives what it was seen as before anybody could write to it.
async fn with_session(store: &Store, session: &str, history: &[f64]) -> RowVersion {
    let policy = content_hash(POLICY);
    store.insert_policy(&Tenant::default(), &policy, POLICY, 1).await.unwrap();
    let new = SessionRow {
        session: session.into(),
        tenant: Tenant::default(),
        policy,
        account: Some(InitialAccount { wealth: 100.0, holding: 0.0 }),
        initial_history: history.into(),
        horizon: 3,
        plan_json: "{}".into(),
        due: None,
        assets: 0,
        created_ms: 5,
    };
    let seen = store.about_to_open(&new);
    assert_eq!(store.create_session(new, Relabel::default(), None).await.unwrap(), CreateSession::Created);
    seen
}

fn observation(session: &str, period: usize, content: &str) -> EntryRow {
    EntryRow {
        session: session.into(),
        entry: period,
        kind: EntryKind::Observation,
        number: period,
        content_json: content.into(),
        answer_json: format!(r#"{{"answer":"{content}"}}"#),
        numbers: Vec::new(),
        created_ms: 7,
        key: "key_1".into(),
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

async fn a_closed_store_answers_unavailable(place: &Place) {
    let store = place.open().await;
    store.close().await;
    store.close().await;
    assert!(matches!(store.ping().await, Err(StoreError::Unavailable { .. })));
    assert!(matches!(store.job("j").await, Err(StoreError::Unavailable { .. })));
    assert!(matches!(store.create_job(new_job("j", None)).await, Err(StoreError::Unavailable { .. })));
}

async fn a_newer_schema_is_refused(place: &Place) {
    let store = place.open().await;
    store.close().await;
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                 VALUES (9000, 'of a later release', TRUE, '00', 0)";
    place.tamper(newer).await;
    let refused = place.try_open().await;
    assert!(matches!(refused, Err(StoreError::NewerSchema { found: 9000, .. })));
}

async fn an_idempotency_key_makes_one_job(place: &Place) {
    let store = place.open().await;
    let CreateJob::Created(first) = store.create_job(new_job("j1", Some("key"))).await.unwrap() else { panic!() };
    assert_eq!((first.state, first.attempt, first.steps_done), (JobState::Queued, 0, 0));
    let store = place.reopen(store).await;
    assert_eq!(store.create_job(new_job("j2", Some("key"))).await.unwrap(), CreateJob::Repeated(first.clone()));
    let other = NewJob { request_hash: "other".into(), ..new_job("j3", Some("key")) };
    assert_eq!(store.create_job(other).await.unwrap(), CreateJob::KeyConflict);
    assert_eq!(store.jobs(&Tenant::default(), 10, None).await.unwrap(), [first]);
}

async fn an_idempotency_key_opens_one_session(place: &Place) {
    let store = place.open().await;
    let second = place.second(&store).await;
    let key = |request: &str| Some(RequestKey { key: "key".into(), request_hash: request.into() });
    let new = |session: &str| session_of("default", session);
    assert_eq!(store.create_session(new("s0"), Relabel::default(), key("a")).await.unwrap(), CreateSession::NoPolicy);
    store.insert_policy(&Tenant::default(), &content_hash(POLICY), POLICY, 1).await.unwrap();
    let opened = join_all((1..=8).map(|n| {
        let store = if n % 2 == 0 { store.clone() } else { second.clone() };
        tokio::spawn(
            async move { store.create_session(new(&format!("s{n}")), Relabel::default(), key("a")).await.unwrap() },
        )
    }));
    let opened: Vec<_> = opened.await.into_iter().map(Result::unwrap).collect();
    let listed = store.sessions(&Tenant::default(), &newest(10)).await.unwrap().sessions;
    let [one] = &listed[..] else { panic!("{listed:?}") };
    assert_eq!(opened.iter().filter(|outcome| **outcome == CreateSession::Created).count(), 1, "{opened:?}");
    let repeated = CreateSession::Repeated(new(&one.session));
    assert_eq!(opened.iter().filter(|outcome| **outcome == repeated).count(), 7, "{opened:?}");

    store.append(observation(&one.session, 1, "c")).await.unwrap();
    let store = place.reopen(store).await;
    assert_eq!(store.create_session(new("s9"), Relabel::default(), key("a")).await.unwrap(), repeated, "as it started");
    assert_eq!(
        store.create_session(new("s9"), Relabel::default(), key("b")).await.unwrap(),
        CreateSession::KeyConflict
    );
    let job = store.create_job(new_job("j", Some("key"))).await.unwrap();
    assert_eq!(job, CreateJob::KeyConflict, "a session has the key");
    store.create_job(new_job("j", Some("job"))).await.unwrap();
    let of_the_job = Some(RequestKey { key: "job".into(), request_hash: "a".into() });
    assert_eq!(
        store.create_session(new("s9"), Relabel::default(), of_the_job).await.unwrap(),
        CreateSession::KeyConflict
    );
    store.insert_policy(&tenant("south"), &content_hash(POLICY), POLICY, 1).await.unwrap();
    let southern = store.create_session(session_of("south", "south"), Relabel::default(), key("b")).await.unwrap();
    assert_eq!(southern, CreateSession::Created, "keys are a tenant's own");

    assert!(store.delete_session(&Tenant::default(), &one.session).await.unwrap());
    let anew = store.create_session(new("s9"), Relabel::default(), key("b")).await.unwrap();
    assert_eq!(anew, CreateSession::Created, "the key went with its session");
}

async fn a_refused_operation_leaves_its_neighbours_alone(place: &Place) {
    let store = place.open().await;
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

async fn jobs_are_listed_newest_first_by_cursor(place: &Place) {
    let store = place.open().await;
    for n in 0..5 {
        queued(&store, &format!("j{n}")).await;
    }
    let first = store.jobs(&Tenant::default(), 2, None).await.unwrap();
    let rest = store.jobs(&Tenant::default(), 10, Some(first[1].sequence)).await.unwrap();
    let names: Vec<_> = first.iter().chain(&rest).map(|row| row.job.as_str()).collect();
    assert_eq!(names, ["j4", "j3", "j2", "j1", "j0"]);
}

async fn the_oldest_job_is_claimed_and_a_lease_that_ran_out_is_taken_over(place: &Place) {
    let store = place.open().await;
    queued(&store, "j1").await;
    queued(&store, "j2").await;
    assert_eq!(claimed(&store, 0).await, ("j1".into(), 1));
    assert_eq!(claimed(&store, 0).await, ("j2".into(), 1));
    assert!(store.renew_lease("j1", 1, 60_000).await.unwrap());
    assert_eq!(claimed(&store, 30_000).await, ("j2".into(), 2));
    assert_eq!(store.claim_job("worker", 30, 30_000).await.unwrap(), None);
    assert_eq!(store.job("j2").await.unwrap().unwrap().started_ms, Some(0));
}

async fn a_worker_that_lost_its_lease_is_fenced_everywhere(place: &Place) {
    let store = place.open().await;
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

async fn a_finished_training_stores_its_policy_and_drops_its_checkpoints(place: &Place) {
    let store = place.open().await;
    queued(&store, "j").await;
    let (_, attempt) = claimed(&store, 1).await;
    assert!(store.save_checkpoint("j", attempt, 9, b"nine").await.unwrap());
    let policy_id = content_hash(POLICY);
    let outcome = JobOutcome::Succeeded { policy_id: policy_id.clone(), policy_json: POLICY.into() };
    assert!(store.finish_job("j", attempt, outcome.clone(), 77).await.unwrap());
    assert!(!store.finish_job("j", attempt, outcome, 78).await.unwrap());
    let store = place.reopen(store).await;
    let row = store.job("j").await.unwrap().unwrap();
    assert_eq!((row.state, row.steps_done, row.finished_ms), (JobState::Succeeded, 10, Some(77)));
    assert_eq!(row.policy, Some(policy_id.clone()));
    assert_eq!(store.policy(&Tenant::default(), &policy_id).await.unwrap().unwrap().json, POLICY);
    assert_eq!(store.checkpoints("j").await.unwrap(), []);
    assert_eq!(store.request_cancel("j", 99).await.unwrap().unwrap(), row);
}

async fn failures_and_reports_end_a_job(place: &Place) {
    let store = place.open().await;
    queued(&store, "fails").await;
    queued(&store, "reports").await;
    let (_, attempt) = claimed(&store, 1).await;
    assert!(store.finish_job("fails", attempt, JobOutcome::Failed { reason: "singular".into() }, 2).await.unwrap());
    let (_, attempt) = claimed(&store, 3).await;
    let report = JobOutcome::Reported { report_json: "{}".into() };
    assert!(store.finish_job("reports", attempt, report, 4).await.unwrap());
    assert_eq!(store.job("fails").await.unwrap().unwrap().error.as_deref(), Some("singular"));
    assert_eq!(store.report(&Tenant::default(), "reports").await.unwrap().as_deref(), Some("{}"));
    let counts = store.count_jobs_by_state().await.unwrap();
    assert_eq!(counts, JobCounts { failed: 1, succeeded: 1, ..JobCounts::default() });
}

async fn cancelling_ends_a_queued_job_and_flags_a_running_one(place: &Place) {
    let store = place.open().await;
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

async fn a_job_asked_to_stop_is_not_claimed_again(place: &Place) {
    let store = place.open().await;
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

async fn a_job_under_which_three_workers_died_fails(place: &Place) {
    let store = place.open().await;
    queued(&store, "poison").await;
    let mut now = 0;
    // A worker that stops in order is no death, and neither is one that saved a step.
    for life in ["released", "dies", "dies", "saves and dies", "dies", "dies"] {
        let (_, attempt) = claimed(&store, now).await;
        match life {
            "released" => assert!(store.release_job("poison", attempt, now).await.unwrap()),
            "saves and dies" => assert!(store.save_checkpoint("poison", attempt, 9, b"nine").await.unwrap()),
            _ => {}
        }
        now += 50_000;
    }
    assert_eq!(store.claim_job("worker", 30, now).await.unwrap(), None);
    let row = store.job("poison").await.unwrap().unwrap();
    assert_eq!((row.state, row.attempt, row.finished_ms), (JobState::Failed, 6, Some(now)));
    assert!(row.error.unwrap().contains("ended 3 times while the job ran"));
    assert_eq!(store.checkpoints("poison").await.unwrap(), []);
    store.close().await;
}

async fn a_released_job_resumes_from_its_checkpoints(place: &Place) {
    let store = place.open().await;
    queued(&store, "j").await;
    let (_, attempt) = claimed(&store, 0).await;
    for step in [9, 8] {
        assert!(store.save_checkpoint("j", attempt, step, &[step as u8; 100]).await.unwrap());
    }
    assert!(store.release_job("j", attempt, 1).await.unwrap());
    let store = place.reopen(store).await;
    let (_, attempt) = claimed(&store, 2).await;
    assert_eq!(attempt, 2);
    assert_eq!(store.checkpoints("j").await.unwrap(), [(8, vec![8; 100]), (9, vec![9; 100])]);
    store.close().await;
    place.tamper("UPDATE checkpoints SET bytes = substr(bytes, 1, 1) WHERE step = 8").await;
    let store = place.open().await;
    assert!(matches!(store.checkpoints("j").await, Err(StoreError::Corrupt { .. })));
}

async fn a_policy_is_stored_once_listed_and_kept_while_in_use(place: &Place) {
    let store = place.open().await;
    let policy = content_hash(POLICY);
    assert!(matches!(
        store.insert_policy(&Tenant::default(), "other", POLICY, 1).await,
        Err(StoreError::Corrupt { .. })
    ));
    assert!(store.insert_policy(&Tenant::default(), &policy, POLICY, 1).await.unwrap());
    assert!(!store.insert_policy(&Tenant::default(), &policy, POLICY, 2).await.unwrap());
    let listed = store.policies(&Tenant::default(), 10, None).await.unwrap();
    assert_eq!((listed.len(), listed[0].created_ms, listed[0].bytes), (1, 1, POLICY.len() as u64));
    assert_eq!(store.policies(&Tenant::default(), 10, Some(listed[0].sequence)).await.unwrap(), []);
    with_session(&store, "s", &[0.1, 0.2]).await;
    assert_eq!(store.delete_policy(&Tenant::default(), &policy).await.unwrap(), DeletePolicy::InUse { sessions: 1 });
    assert!(store.delete_session(&Tenant::default(), "s").await.unwrap());
    assert_eq!(store.delete_policy(&Tenant::default(), &policy).await.unwrap(), DeletePolicy::Deleted);
    assert_eq!(store.delete_policy(&Tenant::default(), &policy).await.unwrap(), DeletePolicy::Absent);
    assert_eq!(store.policy(&Tenant::default(), &policy).await.unwrap(), None);
}

async fn a_damaged_policy_is_detected(place: &Place) {
    let store = place.open().await;
    let policy = content_hash(POLICY);
    store.insert_policy(&Tenant::default(), &policy, POLICY, 1).await.unwrap();
    store.close().await;
    place.tamper("UPDATE policies SET json = substr(json, 1, 2)").await;
    let store = place.open().await;
    assert!(matches!(store.policy(&Tenant::default(), &policy).await, Err(StoreError::Corrupt { .. })));
    store.ping().await.unwrap();
}

async fn a_session_needs_its_policy_and_a_free_name(place: &Place) {
    let store = place.open().await;
    let new = SessionRow {
        session: "s".into(),
        tenant: Tenant::default(),
        policy: "none".into(),
        account: Some(InitialAccount { wealth: 1.0, holding: 0.0 }),
        initial_history: vec![],
        horizon: 1,
        plan_json: "{}".into(),
        due: None,
        assets: 0,
        created_ms: 1,
    };
    assert_eq!(store.create_session(new.clone(), Relabel::default(), None).await.unwrap(), CreateSession::NoPolicy);
    with_session(&store, "s", &[0.1, 0.2]).await;
    let again = SessionRow { policy: content_hash(POLICY), ..new };
    assert_eq!(store.create_session(again, Relabel::default(), None).await.unwrap(), CreateSession::Exists);
    assert_eq!(store.session(&Tenant::default(), "s").await.unwrap().unwrap().account.unwrap().wealth, 100.0);
    assert_eq!(store.session(&Tenant::default(), "nobody").await.unwrap(), None);
    assert!(!store.delete_session(&Tenant::default(), "nobody").await.unwrap());
    assert_eq!(store.count_sessions().await.unwrap(), 1);
}

async fn a_restart_keeps_sessions_bit_for_bit(place: &Place) {
    let store = place.open().await;
    let history = [0.1, -0.0, 5e-324, -1.0 / 3.0, f64::MAX];
    with_session(&store, "s", &history).await;
    for period in 1..=3 {
        let appended = store.append(observation("s", period, "c")).await.unwrap();
        assert_eq!(appended, Append::Appended);
    }
    let store = place.reopen(store).await;
    let row = store.session(&Tenant::default(), "s").await.unwrap().unwrap();
    assert_eq!(bits(&row.initial_history), bits(&history));
    let read = store.entries("s").await.unwrap().unwrap();
    assert_eq!(read, [1, 2, 3].map(|period| observation("s", period, "c")));
    assert_eq!(store.entry("s", EntryKind::Observation, 2).await.unwrap().as_ref(), Some(&read[1]));
    assert_eq!(store.entry("s", EntryKind::Correction, 2).await.unwrap(), None);
    assert_eq!(store.sessions(&Tenant::default(), &newest(10)).await.unwrap().sessions[0].observations, 3);
}

async fn what_was_seen_is_current_until_somebody_writes(place: &Place) {
    let here = Tenant::default();
    let store = place.open().await;
    let second = place.second(&store).await;
    let mut new = with_session(&store, "s", &[0.1, 0.2]).await;
    with_session(&store, "other", &[0.1, 0.2]).await;
    assert!(store.is_as_seen("s", &mut new).await.unwrap());
    assert!(store.session_facts(&tenant("south"), "s").await.unwrap().is_none());
    let facts = store.session_facts(&here, "s").await.unwrap().unwrap();
    let (mut seen, mut opened) = (facts.seen, facts.row.as_opened());
    assert!(facts.entries.is_empty());
    let own = observation("s", 1, "c");
    let mut next = seen.followed_by(&own);
    store.append(own).await.unwrap();
    store.append(observation("other", 1, "c")).await.unwrap();
    for (seen, is_current) in [(&mut new, false), (&mut seen, false), (&mut opened, false), (&mut next, true)] {
        assert_eq!(store.is_as_seen("s", seen).await.unwrap(), is_current, "{seen:?}");
        assert_eq!(store.is_as_seen("s", seen).await.unwrap(), is_current, "{seen:?}, asked again");
    }
    // A refused write changes nothing, though it might have.
    assert!(!second.delete_session(&tenant("south"), "s").await.unwrap());
    assert_eq!(second.append(observation("s", 1, "d")).await.unwrap(), Append::NotNext);
    assert!(store.is_as_seen("s", &mut next).await.unwrap());
    second.append(observation("s", 2, "c")).await.unwrap();
    assert!(!store.is_as_seen("s", &mut next).await.unwrap());
    let facts = store.session_facts(&here, "s").await.unwrap().unwrap();
    let mut seen = facts.seen;
    assert_eq!((facts.entries.len(), seen.entries()), (2, 2));
    assert!(second.delete_session(&here, "s").await.unwrap());
    assert!(!store.is_as_seen("s", &mut seen).await.unwrap());
    assert!(store.session_facts(&here, "s").await.unwrap().is_none());
    // Nobody waits for the answer, and still the write shows once it is stored. One that is under way may show before.
    with_session(&store, "later", &[0.1, 0.2]).await;
    let mut seen = store.session_facts(&here, "other").await.unwrap().unwrap().seen;
    drop(tokio::time::timeout(Duration::ZERO, store.append(observation("other", 2, "c"))).await);
    assert_eq!(store.append(observation("later", 1, "c")).await.unwrap(), Append::Appended);
    let is_written = store.entry("other", EntryKind::Observation, 2).await.unwrap().is_some();
    assert!(!store.is_as_seen("other", &mut seen).await.unwrap() || !is_written);
}

async fn every_entry_is_stored_once_and_in_order(place: &Place) {
    let store = place.open().await;
    assert_eq!(store.append(observation("s", 1, "a")).await.unwrap(), Append::NoSession);
    with_session(&store, "s", &[0.1, 0.2]).await;
    let correction = |entry, number| EntryRow { kind: EntryKind::Correction, number, ..observation("s", entry, "a") };
    assert_eq!(store.append(EntryRow { session: "t".into(), ..correction(1, 1) }).await.unwrap(), Append::NoSession);
    let append = async |new| store.append(new).await.unwrap();
    for (new, expected) in [
        (observation("s", 2, "a"), Append::NotNext),
        (observation("s", 0, "a"), Append::NotNext),
        (observation("s", 1, "a"), Append::Appended),
        (observation("s", 1, "a"), Append::NotNext),
        (correction(1, 1), Append::NotNext),
        (correction(2, 1), Append::Appended),
        (observation("s", 2, "a"), Append::NotNext),
        (EntryRow { number: 2, ..observation("s", 3, "a") }, Append::Appended),
        (correction(5, 2), Append::NotNext),
    ] {
        assert_eq!(append(new.clone()).await, expected, "{new:?}");
    }
    // The second of its kind, and not the second entry.
    let second = store.entry("s", EntryKind::Observation, 2).await.unwrap().unwrap();
    assert_eq!((second.entry, second.number), (3, 2));
    assert_eq!(store.sessions(&Tenant::default(), &newest(10)).await.unwrap().sessions[0].observations, 2);
    let summary = |row: AuditRow| (row.deed, row.outcome);
    let filter = AuditFilter { object: Some("s".into()), ..AuditFilter::default() };
    let audit = store.deeds(&filter, 10, None).await.unwrap().into_iter().map(summary);
    let corrected = ("session.correct".to_owned(), "correction 1 recorded".to_owned());
    assert_eq!(audit.filter(|deed| *deed == corrected).count(), 1);
    assert!(store.delete_session(&Tenant::default(), "s").await.unwrap());
    assert_eq!(store.entries("s").await.unwrap(), None);
    assert_eq!(store.usage(&Tenant::default()).await.unwrap().sessions, 0);
}

async fn sixteen_reports_of_each_period_have_one_winner(place: &Place) {
    const PERIODS: usize = 20;
    let store = place.open().await;
    let second = place.second(&store).await;
    with_session(&store, "s", &[0.1, 0.2]).await;
    for period in 1..=PERIODS {
        let reports = (0..16).map(|client| {
            let store = if client % 2 == 0 { store.clone() } else { second.clone() };
            let report = observation("s", period, &format!("c{client}"));
            tokio::spawn(async move { store.append(report).await.unwrap() })
        });
        let outcomes: Vec<_> = join_all(reports).await.into_iter().map(Result::unwrap).collect();
        let count = |wanted: Append| outcomes.iter().filter(|outcome| **outcome == wanted).count();
        assert_eq!((count(Append::Appended), count(Append::NotNext)), (1, 15), "{outcomes:?}");
    }
    assert_eq!(store.entries("s").await.unwrap().unwrap().len(), PERIODS);
}

async fn many_sessions_commit_in_groups(place: &Place) {
    let store = place.open().await;
    for session in 0..50 {
        with_session(&store, &format!("s{session}"), &[0.1, 0.2]).await;
    }
    for period in 1..=4 {
        let appends = (0..50).map(|session| {
            let store = store.clone();
            async move { store.append(observation(&format!("s{session}"), period, "c")).await }
        });
        let appends = futures_util::future::join_all(appends.map(tokio::spawn)).await;
        assert!(appends.into_iter().all(|append| append.unwrap().unwrap() == Append::Appended));
    }
    let store = place.reopen(store).await;
    let listed = store.sessions(&Tenant::default(), &newest(100)).await.unwrap().sessions;
    assert_eq!(listed.len(), 50);
    assert!(listed.iter().all(|session| session.observations == 4));
}

async fn damage_to_what_an_action_rests_on_is_detected(place: &Place) {
    let damages = [
        "UPDATE sessions SET initial_history = substr(initial_history, 1, 8)",
        "UPDATE sessions SET initial_history = substr(initial_history, 1, 7)",
        "UPDATE sessions SET initial_wealth = 1e6",
        "UPDATE entries SET content_json = '{}' WHERE entry = 2",
        "UPDATE entries SET answer_json = '{}' WHERE entry = 1",
        "UPDATE entries SET kind = 'correction' WHERE entry = 1",
        "UPDATE entries SET number = 7 WHERE entry = 1",
        "DELETE FROM entries WHERE entry = 1",
    ];
    for damage in damages {
        let store = place.open().await;
        store.delete_session(&Tenant::default(), "s").await.unwrap();
        with_session(&store, "s", &[0.1, 0.2]).await;
        for period in 1..=2 {
            store.append(observation("s", period, "c")).await.unwrap();
        }
        store.close().await;
        place.tamper(damage).await;
        let store = place.open().await;
        let damaged = match damage.contains("sessions") {
            true => store.session(&Tenant::default(), "s").await.err(),
            false => store.entries("s").await.err(),
        };
        assert!(matches!(damaged, Some(StoreError::Corrupt { .. })), "{damage}: {damaged:?}");
        store.close().await;
    }
}

async fn reads_run_on_any_thread(place: &Place) {
    let store = place.open().await;
    with_session(&store, "s", &[0.1, 0.2]).await;
    let read = tokio::spawn(async move {
        store.ping().await?;
        store.checkpoints("j").await?;
        store.count_jobs_by_state().await?;
        store.policy(&Tenant::default(), &content_hash(POLICY)).await?;
        store.policies(&Tenant::default(), 1, None).await?;
        store.jobs(&Tenant::default(), 1, None).await?;
        store.entries("s").await?;
        store.sessions(&Tenant::default(), &newest(1)).await?;
        store.session(&Tenant::default(), "s").await
    });
    assert_eq!(read.await.unwrap().unwrap().unwrap().session, "s");
}

/// Everything two replicas can do to each other's jobs, keys and policies at the same moment.
async fn two_replicas_meet(place: &Place) {
    let store = place.open().await;
    let second = place.second(&store).await;
    // Connections take longer to open than the races below last.
    join_all((0..10).flat_map(|_| [store.ping(), second.ping()])).await;
    let either = |n: usize| if n.is_multiple_of(2) { store.clone() } else { second.clone() };

    let keyed = (0..8).map(|n| {
        let store = either(n);
        tokio::spawn(async move { store.create_job(new_job(&format!("k{n}"), Some("key"))).await.unwrap() })
    });
    let keyed: Vec<_> = join_all(keyed).await.into_iter().map(Result::unwrap).collect();
    assert_eq!(keyed.iter().filter(|outcome| matches!(outcome, CreateJob::Created(_))).count(), 1, "{keyed:?}");
    let first = store.jobs(&Tenant::default(), 10, None).await.unwrap();
    assert_eq!(first.len(), 1, "{first:?}");
    assert!(keyed.iter().all(|outcome| matches!(outcome,
        CreateJob::Created(row) | CreateJob::Repeated(row) if row.job == first[0].job)));

    for n in 1..20 {
        queued(&store, &format!("j{n}")).await;
    }
    let claims = (0..40).map(|n| {
        let store = either(n);
        tokio::spawn(async move { store.claim_job("worker", 30, 0).await.unwrap() })
    });
    let mut claimed: Vec<_> =
        join_all(claims).await.into_iter().filter_map(|claim| Some(claim.unwrap()?.row.job)).collect();
    // A claim that met another may come away with nothing while there was still a job.
    while let Some(late) = store.claim_job("worker", 30, 0).await.unwrap() {
        claimed.push(late.row.job);
    }
    claimed.sort();
    assert!(claimed.windows(2).all(|pair| pair[0] != pair[1]), "claimed twice: {claimed:?}");
    assert_eq!((claimed.len(), store.count_jobs_by_state().await.unwrap().running), (20, 20));

    let policy = content_hash(POLICY);
    for round in 0..10 {
        store.insert_policy(&Tenant::default(), &policy, POLICY, 1).await.unwrap();
        let session = format!("s{round}");
        let new = SessionRow {
            session: session.clone(),
            tenant: Tenant::default(),
            policy: policy.clone(),
            account: Some(InitialAccount { wealth: 1.0, holding: 0.0 }),
            initial_history: vec![0.1],
            horizon: 1,
            plan_json: "{}".into(),
            due: None,
            assets: 0,
            created_ms: 1,
        };
        let tenant = Tenant::default();
        match tokio::join!(store.create_session(new, Relabel::default(), None), second.delete_policy(&tenant, &policy))
        {
            (Ok(CreateSession::Created), Ok(DeletePolicy::InUse { sessions: 1 })) => {
                assert!(second.delete_session(&Tenant::default(), &session).await.unwrap());
            }
            (Ok(CreateSession::NoPolicy), Ok(DeletePolicy::Deleted)) => {}
            met => panic!("{met:?}"),
        }
    }
}

async fn a_head_follows_the_rows(place: &Place) {
    let store = place.open().await;
    let second = place.second(&store).await;
    assert_eq!(store.head("s").await.unwrap(), None);
    with_session(&store, "s", &[0.1, 0.2]).await;
    let mut heads = vec![store.session(&Tenant::default(), "s").await.unwrap().unwrap().head()];
    assert_eq!(second.head("s").await.unwrap().as_ref(), heads.last());
    for period in 1..=3 {
        let new = observation("s", period, "c");
        heads.push(new.head());
        store.append(new).await.unwrap();
        let head = second.head("s").await.unwrap();
        assert_eq!((head.as_ref(), head.as_ref().map(|head| head.entries)), (heads.last(), Some(period)));
        assert_eq!(store.entries("s").await.unwrap().unwrap()[period - 1].head(), heads[period]);
    }
    let other = EntryRow { created_ms: 8, ..observation("s", 3, "c") };
    assert_ne!(other.head(), heads[3], "the same report at another time");
    assert!(second.delete_session(&Tenant::default(), "s").await.unwrap());
    assert_eq!(store.head("s").await.unwrap(), None);
}

async fn a_name_nobody_can_have_finds_nothing(place: &Place) {
    let store = place.open().await;
    for name in ["", "a\0b", "\u{1f4a9}", "'; DROP TABLE jobs; --"] {
        assert_eq!(store.job(name).await.unwrap(), None);
        assert_eq!(store.request_cancel(name, 1).await.unwrap(), None);
        assert_eq!(store.policy(&Tenant::default(), name).await.unwrap(), None);
        assert_eq!(store.delete_policy(&Tenant::default(), name).await.unwrap(), DeletePolicy::Absent);
        assert_eq!(store.session(&Tenant::default(), name).await.unwrap(), None);
        assert_eq!(store.append(observation(name, 1, "c")).await.unwrap(), Append::NoSession);
    }
}

#[tokio::test]
async fn a_second_open_of_a_folder_is_refused_until_the_first_closes() {
    let place = Place::folder();
    let store = place.open().await;
    store.ping().await.unwrap();
    assert!(matches!(place.try_open().await, Err(StoreError::Locked { .. })));
    place.reopen(store).await.ping().await.unwrap();
}

#[tokio::test]
async fn a_file_that_is_no_database_is_fatal() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ballast.sqlite"), [b'x'; 8192]).unwrap();
    let refused = Store::open(folder.path()).await.err().expect("a refusal");
    assert!(refused.is_fatal(), "{refused:?}");
}

/// SQLite silently drops every commit of a log from a damaged page on.
#[tokio::test]
async fn a_damaged_log_is_refused_and_a_sound_one_is_not() {
    const LOG: &str = "ballast.sqlite-wal";
    let (running, crashed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let store = Store::open(running.path()).await.unwrap();
    for job in ["first", "second", "third"] {
        queued(&store, job).await;
    }
    // As a crash leaves them.
    for file in ["ballast.sqlite", LOG] {
        std::fs::copy(running.path().join(file), crashed.path().join(file)).unwrap();
    }
    store.close().await;
    let log = crashed.path().join(LOG);
    let sound = std::fs::read(&log).unwrap();
    let mut damaged = sound.clone();
    // In the first page, after the head of the log, of 32 bytes, and that of the page, of 24.
    damaged[32 + 24 + 100] ^= 1;
    std::fs::write(&log, damaged).unwrap();
    let refused = Store::open(crashed.path()).await.err().expect("a refusal");
    assert!(matches!(refused, StoreError::Corrupt { .. }), "{refused:?}");
    std::fs::write(&log, sound).unwrap();
    let store = Store::open(crashed.path()).await.unwrap();
    assert!(store.job("third").await.unwrap().is_some());
}

#[tokio::test]
async fn a_schema_that_is_not_text_is_refused() {
    const COLUMN: &[u8] = b"answer_json";
    let folder = tempfile::tempdir().unwrap();
    Store::open(folder.path()).await.unwrap().close().await;
    let file = folder.path().join("ballast.sqlite");
    let mut bytes = std::fs::read(&file).unwrap();
    let places: Vec<usize> = (0..bytes.len()).filter(|&at| bytes[at..].starts_with(COLUMN)).collect();
    assert!(!places.is_empty());
    places.iter().for_each(|&at| bytes[at] = 0xff);
    std::fs::write(&file, bytes).unwrap();
    let refused = Store::open(folder.path()).await.err().expect("a refusal");
    assert!(matches!(refused, StoreError::Corrupt { .. }), "{refused:?}");
}

#[tokio::test]
async fn opening_a_folder_ends_the_leases_of_the_dead() {
    let place = Place::folder();
    let store = place.open().await;
    queued(&store, "j").await;
    let (_, dead) = claimed(&store, 0).await;
    assert_eq!(store.claim_job("worker", 30, 1).await.unwrap(), None);
    let store = place.reopen(store).await;
    assert_eq!(claimed(&store, 1).await, ("j".into(), dead + 1));
    assert!(!store.save_checkpoint("j", dead, 9, b"late").await.unwrap());
    assert_eq!(store.lease_time(77).await.unwrap(), 77);
}

#[tokio::test]
async fn opening_a_database_leaves_the_leases_of_the_living_and_measures_them_by_its_own_clock() {
    let Some(place) = Place::database().await else { return };
    let store = place.open().await;
    queued(&store, "j").await;
    let (_, living) = claimed(&store, 0).await;
    let replicas = join_all((0..4).map(|_| place.open())).await;
    for replica in &replicas {
        assert_eq!(replica.claim_job("worker", 30, 1).await.unwrap(), None);
    }
    assert!(store.save_checkpoint("j", living, 9, b"nine").await.unwrap());
    let local = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_millis() as i64;
    let server = store.lease_time(77).await.unwrap();
    assert!((server - local).abs() < 60_000, "{server} on the server, {local} here");
    assert!(replicas[0].lease_time(77).await.unwrap() >= server);
}

#[tokio::test]
async fn a_server_that_is_not_there_is_unavailable() {
    let nowhere = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let refused = Store::connect(&format!("postgres://ballast@{nowhere}/ballast").parse().unwrap()).await;
    assert!(matches!(refused, Err(StoreError::Unavailable { .. })), "{:?}", refused.err());
}

fn tenant(name: &str) -> Tenant {
    name.parse().unwrap()
}

fn session_of(owner: &str, session: &str) -> SessionRow {
    SessionRow {
        session: session.into(),
        tenant: tenant(owner),
        policy: content_hash(POLICY),
        account: Some(InitialAccount { wealth: 100.0, holding: 0.0 }),
        initial_history: vec![0.01, -0.02],
        horizon: 3,
        plan_json: "{}".into(),
        due: None,
        assets: 0,
        created_ms: 5,
    }
}

async fn tenants_see_only_their_own(place: &Place) {
    let store = place.open().await;
    let (north, south) = (tenant("north"), tenant("south"));
    let policy = content_hash(POLICY);
    assert!(store.insert_policy(&north, &policy, POLICY, 1).await.unwrap());
    assert_eq!(
        store.create_session(session_of("south", "s1"), Relabel::default(), None).await.unwrap(),
        CreateSession::NoPolicy
    );
    assert_eq!(store.policy(&south, &policy).await.unwrap(), None);
    assert_eq!(store.delete_policy(&south, &policy).await.unwrap(), DeletePolicy::Absent);
    assert!(store.insert_policy(&south, &policy, POLICY, 2).await.unwrap());
    for (owner, created_ms) in [(&north, 1), (&south, 2)] {
        let row = store.policy(owner, &policy).await.unwrap().unwrap();
        assert_eq!((row.created_ms, row.json.as_slice()), (created_ms, POLICY));
        assert_eq!(store.policies(owner, 10, None).await.unwrap()[0].created_ms, created_ms);
    }
    assert_eq!(
        store.create_session(session_of("south", "s1"), Relabel::default(), None).await.unwrap(),
        CreateSession::Created
    );
    assert_eq!(store.sessions(&north, &newest(10)).await.unwrap().sessions, []);
    assert_eq!(store.sessions(&south, &newest(10)).await.unwrap().sessions.len(), 1);
    assert!(!store.delete_session(&north, "s1").await.unwrap());
    // The sessions of one tenant keep its policy, not that of another; the bytes go with the last owner.
    assert_eq!(store.delete_policy(&north, &policy).await.unwrap(), DeletePolicy::Deleted);
    assert_eq!(store.delete_policy(&south, &policy).await.unwrap(), DeletePolicy::InUse { sessions: 1 });
    assert!(store.delete_session(&south, "s1").await.unwrap());
    assert_eq!(store.delete_policy(&south, &policy).await.unwrap(), DeletePolicy::Deleted);
    assert_eq!(store.policy(&south, &policy).await.unwrap(), None);

    let job = |owner: &str, job: &str| NewJob { tenant: tenant(owner), ..new_job(job, Some("key")) };
    for (owner, name) in [("north", "n1"), ("south", "t1")] {
        assert!(matches!(store.create_job(job(owner, name)).await.unwrap(), CreateJob::Created(_)));
        let repeated = store.create_job(job(owner, "other")).await.unwrap();
        assert!(matches!(repeated, CreateJob::Repeated(row) if row.job == name));
        let listed = store.jobs(&tenant(owner), 10, None).await.unwrap();
        assert_eq!(listed.iter().map(|row| row.job.as_str()).collect::<Vec<_>>(), [name]);
    }
    let claimed = store.claim_job("w", 10, 0).await.unwrap().unwrap();
    let outcome = JobOutcome::Succeeded { policy_id: policy.clone(), policy_json: POLICY.to_vec() };
    assert!(store.finish_job("n1", claimed.attempt, outcome, 9).await.unwrap());
    assert_eq!(store.policy(&north, &policy).await.unwrap().unwrap().created_ms, 9);
    assert_eq!(store.policy(&south, &policy).await.unwrap(), None);
}

/// Over a folder, the store is open and holds the lock.
async fn a_key_is_listed_and_revoked_beside_the_store(place: &Place) {
    let store = place.open().await;
    assert!(store.keys().await.unwrap().is_empty());
    let ring = place.key_ring().await.unwrap();
    let new = NewKey {
        key: "key_1".into(),
        hash: [7; 32],
        tenant: tenant("north"),
        roles: "operate,read".parse().unwrap(),
        created_ms: 3,
        expires_ms: Some(103),
    };
    ring.create(new.clone()).await.unwrap();
    assert!(ring.create(NewKey { key: "key_2".into(), ..new.clone() }).await.is_err(), "two keys of one text");
    let rows = store.keys().await.unwrap().sound;
    assert_eq!(rows, ring.list().await.unwrap().sound);
    assert_eq!((rows[0].hash, &rows[0].tenant, rows[0].revoked_ms), (new.hash, &new.tenant, None));
    assert_eq!(rows[0].roles.to_string(), "read,operate");
    let successor = Successor { key: "key_2".into(), hash: [8; 32], created_ms: 5, expires_ms: None };
    let Rotation::Rotated { old, new } = ring.rotate("key_1", successor.clone(), 50).await.unwrap() else { panic!() };
    assert_eq!((old.expires_ms, new.expires_ms), (Some(50), Some(105)), "as long as the one before was made for");
    assert_eq!((&new.tenant, &new.roles), (&old.tenant, &old.roles));
    assert_eq!(store.keys().await.unwrap().sound, [*old, *new.clone()]);
    let again = |created_ms| Successor { key: format!("key_{created_ms}"), created_ms, ..successor.clone() };
    assert!(ring.rotate("key_1", again(6), 60).await.is_err(), "two keys of one text");
    assert_eq!(ring.list().await.unwrap().sound[0].expires_ms, Some(50), "all of a rotation or nothing");
    assert_eq!(ring.rotate("key_1", again(50), 60).await.unwrap(), Rotation::Ended);
    assert_eq!(ring.rotate("key_9", again(6), 60).await.unwrap(), Rotation::Absent);
    assert!(!ring.revoke("key_3", 4).await.unwrap());
    assert!(ring.revoke("key_1", 4).await.unwrap() && ring.revoke("key_1", 5).await.unwrap());
    assert_eq!(store.keys().await.unwrap().sound[0].revoked_ms, Some(4));
    ring.close().await;
    // The store writes on, and keys can be made where nobody serves it.
    queued(&store, "j1").await;
    store.close().await;
    let ring = place.key_ring().await.unwrap();
    assert_eq!(ring.list().await.unwrap().sound.len(), 2);
    ring.close().await;
    // Whatever is altered of a key, it is none, and the other is one still.
    for (damage, mend) in [
        ("roles = 'root'", "roles = 'read,operate'"),
        ("roles = 'admin'", "roles = 'read,operate'"),
        ("tenant = 'south'", "tenant = 'north'"),
        ("revoked_ms = NULL", "revoked_ms = 4"),
        ("expires_ms = NULL", "expires_ms = 50"),
    ] {
        place.tamper(&format!("UPDATE access_keys SET {damage} WHERE access_key = 'key_1'")).await;
        let store = place.open().await;
        let StoredKeys { sound, damaged } = store.keys().await.unwrap();
        assert_eq!(
            (sound.as_slice(), damaged.as_slice()),
            ([*new.clone()].as_slice(), ["key key_1".to_owned()].as_slice())
        );
        store.close().await;
        place.tamper(&format!("UPDATE access_keys SET {mend} WHERE access_key = 'key_1'")).await;
    }
}

async fn a_session_moved_to_another_tenant_is_damaged(place: &Place) {
    for (from, to) in [("default", "south"), ("north", "default"), ("north", "south")] {
        let store = place.open().await;
        let session = format!("{from}_{to}");
        store.insert_policy(&tenant(from), &content_hash(POLICY), POLICY, 1).await.unwrap();
        store.create_session(session_of(from, &session), Relabel::default(), None).await.unwrap();
        assert_eq!(store.session(&tenant(from), &session).await.unwrap().unwrap().tenant, tenant(from));
        store.close().await;
        place.tamper(&format!("UPDATE sessions SET tenant = '{to}' WHERE session = '{session}'")).await;
        let store = place.open().await;
        assert!(matches!(store.session(&tenant(to), &session).await, Err(StoreError::Corrupt { .. })));
        store.close().await;
    }
}
