//! Random lists of operations on the store and on a model that a reader can check by eye: equal answers, equal state.
//!
//! The model is maps and vectors in memory, with no transactions, hashes, seals or SQL.

use std::collections::BTreeMap;

use crate::support::place::Place;
use crate::support::random;
use ballast::control::policy::content_hash;
use ballast::store::{
    Append, CreateJob, CreateSession, DeleteJob, DeletePolicy, EntryKind, EntryRow, InitialAccount, JobKind,
    JobOutcome, JobRow, JobState, NewJob, OverQuota, Quota, Quotas, Relabel, SessionQuery, SessionRow, Store,
    StoreError, Tenant, Usage,
};
use proptest::prelude::*;

const CASES: u32 = 24;
const LENGTH: usize = 60;
const LEASE_MS: i64 = 10_000;
const QUOTAS: Quotas = Quotas { queued_jobs: 2, sessions: 2, bytes: 0, audit_entries: 0 };
const TENANTS: u8 = 3;
/// Bytes of a row beside its contents, and of an entry of a session.
const ROW: i64 = 1024;
const ENTRY: i64 = 1536;

/// Names are drawn from so few that operations meet.
#[derive(Debug, Clone)]
enum Operation {
    CreateJob { tenant: u8, job: u8, key: Option<u8>, hash: u8 },
    Claim,
    Renew { job: u8, behind: i64 },
    Checkpoint { job: u8, behind: i64, step: usize, byte: u8 },
    Finish { job: u8, behind: i64, outcome: u8 },
    Release { job: u8, behind: i64 },
    Cancel { job: u8 },
    DeleteJob { tenant: u8, job: u8 },
    ExpireJobs { seconds: i64 },
    InsertPolicy { policy: u8 },
    DeletePolicy { policy: u8 },
    CreateSession { session: u8, policy: u8 },
    DeleteSession { session: u8 },
    Append { session: u8, entry: usize, content: u8 },
    Wait { seconds: i64 },
    Reopen,
}

fn operation() -> impl Strategy<Value = Operation> {
    use Operation as O;
    let (job, policy, session) = (0..12u8, 0..3u8, 0..3u8);
    // Zero is the attempt that holds the job, one the attempt before.
    let behind = prop_oneof![3 => Just(0i64), 1 => Just(1i64)];
    prop_oneof![
        8 => (0..TENANTS, job.clone(), proptest::option::of(0..2u8), 0..2u8)
            .prop_map(|(tenant, job, key, hash)| O::CreateJob { tenant, job, key, hash }),
        4 => Just(O::Claim),
        1 => (job.clone(), behind.clone()).prop_map(|(job, behind)| O::Renew { job, behind }),
        4 => (job.clone(), behind.clone(), 0..3usize, any::<u8>())
            .prop_map(|(job, behind, step, byte)| O::Checkpoint { job, behind, step, byte }),
        3 => (job.clone(), behind.clone(), 0..4u8).prop_map(|(job, behind, outcome)| O::Finish { job, behind, outcome }),
        2 => (job.clone(), behind).prop_map(|(job, behind)| O::Release { job, behind }),
        2 => job.clone().prop_map(|job| O::Cancel { job }),
        2 => (0..TENANTS, job).prop_map(|(tenant, job)| O::DeleteJob { tenant, job }),
        1 => (0..20i64).prop_map(|seconds| O::ExpireJobs { seconds }),
        2 => policy.clone().prop_map(|policy| O::InsertPolicy { policy }),
        1 => policy.clone().prop_map(|policy| O::DeletePolicy { policy }),
        3 => (session.clone(), policy).prop_map(|(session, policy)| O::CreateSession { session, policy }),
        1 => session.clone().prop_map(|session| O::DeleteSession { session }),
        8 => (session, 0..5usize, 0..2u8).prop_map(|(session, entry, content)| O::Append { session, entry, content }),
        2 => (1..12i64).prop_map(|seconds| O::Wait { seconds }),
        1 => Just(O::Reopen),
    ]
}

#[derive(Debug, Clone, PartialEq)]
struct Job {
    tenant: u8,
    name: String,
    state: JobState,
    lease_until: i64,
    attempt: i64,
    deaths: i64,
    cancel: bool,
    steps: BTreeMap<usize, u8>,
    steps_done: usize,
    result: Option<String>,
    started: Option<i64>,
    finished: Option<i64>,
}

#[derive(Default)]
struct Model {
    now: i64,
    jobs: Vec<Job>,
    /// When each tenant was last served: by the how-manieth claim.
    served: [usize; TENANTS as usize],
    claims: usize,
    /// Hash and job of each tenant's key.
    keys: BTreeMap<(u8, u8), (u8, String)>,
    /// Owner and content.
    policies: Vec<(u8, u8)>,
    /// Name, policy and the contents of the entries from 1 on.
    sessions: Vec<(u8, u8, Vec<u8>)>,
}

/// Why a job fails under which three workers died.
const DIED: &str = "its worker process ended 3 times while the job ran, and no step was finished in between; \
                    the job may need more memory than the machine has";

impl Model {
    fn job(&mut self, job: u8) -> Option<&mut Job> {
        self.jobs.iter_mut().find(|row| row.name == job_name(job))
    }

    fn held(&mut self, job: u8, behind: i64) -> Option<&mut Job> {
        self.job(job).filter(|row| row.state == JobState::Running && behind == 0)
    }

    /// The attempt that `behind` stands for.
    fn attempt(&mut self, job: u8, behind: i64) -> i64 {
        self.job(job).map_or(0, |row| row.attempt) - behind
    }

    fn claim(&mut self) -> Option<String> {
        let now = self.now;
        loop {
            let left = |row: &Job| row.state == JobState::Running && row.lease_until <= now;
            let name = match self.jobs.iter().find(|row| left(row)) {
                Some(row) => row.name.clone(),
                None => self.next_in_turn()?,
            };
            let row = self.jobs.iter_mut().find(|row| row.name == name)?;
            if row.cancel {
                row.end(JobState::Cancelled, now);
                continue;
            }
            row.deaths += i64::from(row.state == JobState::Running);
            if row.deaths >= 3 {
                row.end(JobState::Failed, now);
                row.result = Some(DIED.to_owned());
                continue;
            }
            (row.state, row.lease_until, row.attempt) = (JobState::Running, now + LEASE_MS, row.attempt + 1);
            row.started = row.started.or(Some(now));
            return Some(row.name.clone());
        }
    }
}

impl Model {
    /// The oldest queued job of the tenant that was served longest ago.
    fn next_in_turn(&mut self) -> Option<String> {
        let queued = |tenant: u8| self.jobs.iter().find(|row| row.tenant == tenant && row.state == JobState::Queued);
        let waiting = (0..TENANTS).filter(|&tenant| queued(tenant).is_some());
        let tenant = waiting.min_by_key(|&tenant| self.served[usize::from(tenant)])?;
        let name = queued(tenant)?.name.clone();
        self.claims += 1;
        self.served[usize::from(tenant)] = self.claims;
        Some(name)
    }

    fn queued(&self, tenant: u8) -> u64 {
        self.jobs.iter().filter(|row| row.tenant == tenant && row.state == JobState::Queued).count() as u64
    }

    /// Takes away an ended job, and the keys that name it.
    fn forget(&mut self, gone: impl Fn(&Job) -> bool) -> usize {
        let before = self.jobs.len();
        self.jobs.retain(|row| !(row.finished.is_some() && gone(row)));
        self.keys.retain(|_, (_, job)| self.jobs.iter().any(|row| row.name == *job));
        before - self.jobs.len()
    }

    fn usage(&self, tenant: u8) -> Usage {
        let jobs = self.jobs.iter().filter(|row| row.tenant == tenant).map(|row| {
            let request = if row.finished.is_none() { 2 } else { 0 };
            let report = if row.result.as_deref() == Some("{}") { 2 } else { 0 };
            ROW + request + report
        });
        let mut usage = Usage { sessions: 0, bytes: jobs.sum() };
        let policies = self.policies.iter().filter(|policy| policy.0 == tenant);
        usage.bytes += policies.map(|policy| ROW + policy_json(policy.1).len() as i64).sum::<i64>();
        if tenant == 0 {
            usage.sessions = self.sessions.len() as i64;
            let corrections = self.sessions.iter().flat_map(|row| &row.2).filter(|&&content| content == 1).count();
            usage.bytes += usage.sessions * (ROW + 16 + 2 + 3 * ENTRY) + corrections as i64 * ENTRY;
        }
        usage
    }
}

impl Job {
    fn end(&mut self, state: JobState, now: i64) {
        (self.state, self.cancel, self.finished) = (state, false, Some(now));
        self.steps.clear();
    }
}

fn tenant_of(tenant: u8) -> Tenant {
    if tenant == 0 { Tenant::default() } else { format!("other_{tenant}").parse().unwrap() }
}

fn over<T: std::fmt::Debug>(answer: Result<T, StoreError>) -> OverQuota {
    match answer {
        Err(StoreError::OverQuota(over)) => over,
        other => panic!("{other:?}"),
    }
}

fn job_name(job: u8) -> String {
    format!("job_{job}")
}

fn session_name(session: u8) -> String {
    format!("session_{session}")
}

fn policy_json(policy: u8) -> Vec<u8> {
    format!(r#"{{"policy":{policy}}}"#).into_bytes()
}

fn policy_name(policy: u8) -> String {
    content_hash(&policy_json(policy))
}

fn outcome(number: u8) -> JobOutcome {
    match number {
        0 => JobOutcome::Succeeded { policy_id: policy_name(0), policy_json: policy_json(0) },
        1 => JobOutcome::Reported { report_json: "{}".into() },
        2 => JobOutcome::Failed { reason: "singular".into() },
        _ => JobOutcome::Cancelled,
    }
}

/// A correction where the content is 1; store and model know nothing of what it corrects.
fn entry_of(session: u8, entry: usize, content: u8) -> EntryRow {
    EntryRow {
        session: session_name(session),
        entry,
        kind: if content == 1 { EntryKind::Correction } else { EntryKind::Observation },
        number: entry + 10,
        content_json: format!("content_{content}"),
        answer_json: format!(r#"{{"answer":{content}}}"#),
        numbers: Vec::new(),
        created_ms: 7,
        key: String::new(),
    }
}

/// Runs one operation on both and compares the answers.
async fn apply(store: &Store, model: &mut Model, operation: &Operation) {
    use Operation as O;
    let now = model.now;
    match *operation {
        O::CreateJob { tenant, job, key, hash } => create_job(store, model, tenant, job, key, hash).await,
        O::DeleteJob { tenant, job } => {
            let row = model.job(job).filter(|row| row.tenant == tenant);
            let expected = match row.map(|row| row.finished.is_some()) {
                None => DeleteJob::Absent,
                Some(false) => DeleteJob::NotEnded,
                Some(true) => DeleteJob::Deleted,
            };
            assert_eq!(store.delete_job(&tenant_of(tenant), &job_name(job)).await.unwrap(), expected);
            model.forget(|row| row.tenant == tenant && row.name == job_name(job));
        }
        O::ExpireJobs { seconds } => {
            let before = now - 1000 * seconds;
            let expired = store.expire_jobs(before, 100).await.unwrap();
            assert_eq!(expired, model.forget(|row| row.finished.is_some_and(|finished| finished < before)));
        }
        O::Claim => {
            let claimed = store.claim_job("worker", (LEASE_MS / 1000) as u32, now).await.unwrap();
            let expected = model.claim();
            assert_eq!(claimed.as_ref().map(|claimed| &claimed.row.job), expected.as_ref());
        }
        O::Renew { job, behind } => {
            let attempt = model.attempt(job, behind);
            let held = model.held(job, behind).map(|row| row.lease_until = now + LEASE_MS).is_some();
            assert_eq!(store.renew_lease(&job_name(job), attempt, now + LEASE_MS).await.unwrap(), held);
        }
        O::Checkpoint { job, behind, step, byte } => {
            let attempt = model.attempt(job, behind);
            let saved = store.save_checkpoint(&job_name(job), attempt, step, &[byte; 9]).await.unwrap();
            let held = model.held(job, behind).map(|row| {
                row.steps.insert(step, byte);
                (row.steps_done, row.deaths) = (row.steps.len(), 0);
            });
            assert_eq!(saved, held.is_some());
        }
        O::Finish { job, behind, outcome: number } => {
            let attempt = model.attempt(job, behind);
            let finished = store.finish_job(&job_name(job), attempt, outcome(number), now).await.unwrap();
            assert_eq!(finished, finish(model, job, behind, number));
        }
        O::Release { job, behind } => {
            let attempt = model.attempt(job, behind);
            let released = store.release_job(&job_name(job), attempt, now).await.unwrap();
            let held = model.held(job, behind).map(|row| match row.cancel {
                true => row.end(JobState::Cancelled, now),
                false => row.state = JobState::Queued,
            });
            assert_eq!(released, held.is_some());
        }
        O::Cancel { job } => {
            let row = store.request_cancel(&job_name(job), now).await.unwrap();
            let expected = model.job(job).map(|row| {
                match row.state {
                    JobState::Queued => row.end(JobState::Cancelled, now),
                    JobState::Running => row.cancel = true,
                    _ => {}
                }
                row.state
            });
            assert_eq!(row.map(|row| row.state), expected);
        }
        O::Wait { seconds } => model.now += 1000 * seconds,
        O::InsertPolicy { .. }
        | O::DeletePolicy { .. }
        | O::CreateSession { .. }
        | O::DeleteSession { .. }
        | O::Append { .. } => live(store, model, operation).await,
        O::Reopen => unreachable!("the caller reopens"),
    }
}

async fn create_job(store: &Store, model: &mut Model, tenant: u8, job: u8, key: Option<u8>, hash: u8) {
    let new = NewJob {
        job: job_name(job),
        tenant: tenant_of(tenant),
        kind: JobKind::Train,
        request_json: "{}".into(),
        request_hash: hash.to_string(),
        idempotency_key: key.map(|key| key.to_string()),
        labels: Relabel::default(),
        steps_total: 3,
        created_ms: model.now,
    };
    let answer = store.create_job(new).await;
    let queued = model.queued(tenant);
    match key.and_then(|key| model.keys.get(&(tenant, key)).cloned()) {
        Some((used, _)) if used != hash => assert_eq!(answer.unwrap(), CreateJob::KeyConflict),
        Some((_, earlier)) => {
            assert!(matches!(answer.unwrap(), CreateJob::Repeated(row) if row.job == earlier));
        }
        None if queued >= u64::from(QUOTAS.queued_jobs) => {
            let limit = QUOTAS.queued_jobs.into();
            // No more are counted than it takes to refuse; released ones may be more.
            let expected = OverQuota { quota: Quota::QueuedJobs, kept: queued.min(limit), wanted: 1, limit };
            assert_eq!(over(answer), expected);
        }
        None if model.job(job).is_some() => assert!(answer.is_err(), "a name taken twice"),
        None => {
            assert!(matches!(answer.unwrap(), CreateJob::Created(row) if row.state == JobState::Queued));
            if let Some(key) = key {
                model.keys.insert((tenant, key), (hash, job_name(job)));
            }
            model.jobs.push(Job {
                tenant,
                name: job_name(job),
                state: JobState::Queued,
                lease_until: 0,
                attempt: 0,
                deaths: 0,
                cancel: false,
                steps: BTreeMap::new(),
                steps_done: 0,
                result: None,
                started: None,
                finished: None,
            });
        }
    }
}

fn finish(model: &mut Model, job: u8, behind: i64, number: u8) -> bool {
    let now = model.now;
    let Some(row) = model.held(job, behind) else { return false };
    let (state, result) = match number {
        0 => (JobState::Succeeded, Some(policy_name(0))),
        1 => (JobState::Succeeded, Some("{}".into())),
        2 => (JobState::Failed, Some("singular".into())),
        _ => (JobState::Cancelled, None),
    };
    row.end(state, now);
    row.result = result;
    if state == JobState::Succeeded {
        row.steps_done = 3;
    }
    let owned = (row.tenant, 0);
    if number == 0 && !model.policies.contains(&owned) {
        model.policies.push(owned);
    }
    true
}

/// Policies, sessions and entries.
async fn live(store: &Store, model: &mut Model, operation: &Operation) {
    match *operation {
        Operation::InsertPolicy { policy } => {
            let inserted = store
                .insert_policy(&Tenant::default(), &policy_name(policy), &policy_json(policy), model.now)
                .await
                .unwrap();
            assert_eq!(inserted, !model.policies.contains(&(0, policy)));
            if inserted {
                model.policies.push((0, policy));
            }
        }
        Operation::DeletePolicy { policy } => {
            let users = model.sessions.iter().filter(|session| session.1 == policy).count() as u64;
            let expected = match (model.policies.contains(&(0, policy)), users) {
                (false, _) => DeletePolicy::Absent,
                (true, 0) => DeletePolicy::Deleted,
                (true, sessions) => DeletePolicy::InUse { sessions },
            };
            assert_eq!(store.delete_policy(&Tenant::default(), &policy_name(policy)).await.unwrap(), expected);
            model.policies.retain(|&kept| kept != (0, policy) || expected != DeletePolicy::Deleted);
        }
        Operation::CreateSession { session, policy } => {
            let new = SessionRow {
                session: session_name(session),
                tenant: Tenant::default(),
                policy: policy_name(policy),
                account: Some(InitialAccount { wealth: 100.0, holding: 0.0 }),
                initial_history: vec![0.1, -0.0],
                horizon: 3,
                plan_json: "{}".into(),
                due: None,
                assets: 0,
                created_ms: model.now,
            };
            let exists = model.sessions.iter().any(|row| row.0 == session);
            let (kept, limit) = (model.sessions.len() as u64, QUOTAS.sessions.into());
            let expected = match (model.policies.contains(&(0, policy)), exists) {
                (false, _) => CreateSession::NoPolicy,
                (true, true) => CreateSession::Exists,
                (true, false) if kept >= limit => {
                    let expected = OverQuota { quota: Quota::Sessions, kept, wanted: 1, limit };
                    return assert_eq!(over(store.create_session(new, Relabel::default(), None).await), expected);
                }
                (true, false) => CreateSession::Created,
            };
            assert_eq!(store.create_session(new, Relabel::default(), None).await.unwrap(), expected);
            if expected == CreateSession::Created {
                model.sessions.push((session, policy, Vec::new()));
            }
        }
        Operation::DeleteSession { session } => {
            let before = model.sessions.len();
            model.sessions.retain(|row| row.0 != session);
            let deleted = store.delete_session(&Tenant::default(), &session_name(session)).await.unwrap();
            assert_eq!(deleted, model.sessions.len() < before);
        }
        Operation::Append { session, entry, content } => {
            let appended = store.append(entry_of(session, entry, content)).await.unwrap();
            let Some((.., entries)) = model.sessions.iter_mut().find(|row| row.0 == session) else {
                return assert_eq!(appended, Append::NoSession);
            };
            let is_next = entry == entries.len() + 1;
            assert_eq!(appended, if is_next { Append::Appended } else { Append::NotNext });
            if is_next {
                entries.push(content);
            }
        }
        _ => unreachable!("not an operation of live sessions"),
    }
}

/// Everything the store can be asked for is what the model has.
async fn compare(store: &Store, model: &Model) {
    let mut rows = Vec::new();
    for tenant in 0..TENANTS {
        rows.extend(store.jobs(&tenant_of(tenant), 1000, None).await.unwrap());
        assert_eq!(store.usage(&tenant_of(tenant)).await.unwrap(), model.usage(tenant), "tenant {tenant}");
    }
    rows.sort_by_key(|row| row.sequence);
    assert_eq!(rows.len(), model.jobs.len());
    for (row, expected) in rows.iter().zip(&model.jobs) {
        let of = |row: &JobRow| (row.job.clone(), row.state, row.attempt, row.cancel_requested, row.steps_done);
        let (name, state) = (expected.name.clone(), expected.state);
        assert_eq!(of(row), (name, state, expected.attempt, expected.cancel, expected.steps_done));
        assert_eq!((row.started_ms, row.finished_ms), (expected.started, expected.finished));
        assert_eq!(row.tenant, tenant_of(expected.tenant));
        let report = store.report(&row.tenant, &row.job).await.unwrap();
        let results = [&row.policy, &report, &row.error];
        assert_eq!(results.into_iter().flatten().next(), expected.result.as_ref());
        let steps: Vec<_> = expected.steps.iter().map(|(&step, &byte)| (step, vec![byte; 9])).collect();
        assert_eq!(store.checkpoints(&row.job).await.unwrap(), steps);
    }
    let policies = store.policies(&Tenant::default(), 1000, None).await.unwrap();
    let policies: Vec<_> = policies.into_iter().rev().map(|row| row.policy).collect();
    let owned = model.policies.iter().filter(|policy| policy.0 == 0);
    assert_eq!(policies, owned.map(|policy| policy_name(policy.1)).collect::<Vec<_>>());
    let newest = SessionQuery { limit: 1000, descending: true, ..SessionQuery::default() };
    let sessions = store.sessions(&Tenant::default(), &newest).await.unwrap().sessions;
    assert_eq!(sessions.len(), model.sessions.len());
    for (row, (session, policy, contents)) in sessions.iter().rev().zip(&model.sessions) {
        assert_eq!((&row.session, &row.policy), (&session_name(*session), &policy_name(*policy)));
        let entries = store.entries(&row.session).await.unwrap().expect("the session listed");
        let wrote = |(&content, entry)| entry_of(*session, entry, content);
        assert_eq!(entries, contents.iter().zip(1..).map(wrote).collect::<Vec<_>>());
        // The answers of corrections here say of no period that it was observed.
        let observed = entries.last().filter(|entry| entry.kind == EntryKind::Observation);
        assert_eq!(row.observations, observed.map_or(0, |entry| entry.number));
    }
}

async fn replay(place: &Place, operations: &[Operation]) -> Result<(), TestCaseError> {
    let (mut store, mut model) = (place.open().await.with_quotas(QUOTAS), Model::default());
    for operation in operations {
        if let Operation::Reopen = operation {
            store = place.reopen(store).await.with_quotas(QUOTAS);
            // A folder has no other process: whoever ran a job is gone.
            if let Place::Folder(_) = place {
                model.jobs.iter_mut().for_each(|row| row.lease_until = i64::MIN);
            }
            continue;
        }
        apply(&store, &mut model, operation).await;
    }
    compare(&store, &model).await;
    store.close().await;
    Ok(())
}

const TABLES: &str = "jobs, job_requests, job_reports, idempotency_keys, checkpoints, turns, usage, policies, \
                      policy_owners, sessions, reminders, links, entries, renewals";

#[test]
fn sqlite_does_what_the_model_does() {
    random::over_folders(CASES, &operations(), async |place, operations| replay(place, operations).await);
}

#[test]
fn postgresql_does_what_the_model_does() {
    random::over_a_database(TABLES, CASES, &operations(), async |place, operations| replay(place, operations).await);
}

fn operations() -> impl Strategy<Value = Vec<Operation>> {
    proptest::collection::vec(operation(), LENGTH)
}
