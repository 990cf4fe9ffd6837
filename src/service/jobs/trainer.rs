//! The worker: claims jobs one at a time and solves them step by step, with a checkpoint after each.
//!
//! It runs on a thread of its own with a pool of its own, so that the threads that answer requests stay free. Every
//! stop (a cancel, a shutdown, a lost lease) ends in `release_job`. The store knows whether a cancel was requested, and
//! requeues the job or cancels it. A worker that lost its lease changes nothing. The work itself checks the stop signal
//! often, but not
//! inside a factorisation, which takes a minute at ten thousand points. After [`PATIENCE`] the job is released without
//! waiting for it, and what it still computes is dropped.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::runtime::Handle;

use crate::control::error::TrainError;
use crate::control::estimate::Footprint;
use crate::control::pool::TrainingPool;
use crate::service::callers::identity;
use crate::service::error::ServiceError;
use crate::service::jobs::progress::ProgressBoard;
use crate::service::process::clock::Clock;
use crate::service::process::config::Config;
use crate::service::process::memory::{Memory, Reserved};
use crate::service::process::shutdown::Shutdown;
use crate::store::{ClaimedJob, JobKind, JobOutcome, Store, StoreError};

mod backtesting;
mod evaluating;
mod frontier;
mod training;

/// Interval for polling the queue without a notification: a lease may have run out, or another replica queued a job.
const QUEUE_POLL: Duration = Duration::from_secs(1);
/// Interval for asking the store whether the running job should stop: half the second a cancel may take.
const CANCEL_POLL: Duration = Duration::from_millis(500);

/// Interval for checking the stop signal, and the time for stopped work to end by itself. Together with [`CANCEL_POLL`]
/// they stay below the second a cancel may take.
const STOP_POLL: Duration = Duration::from_millis(50);
const PATIENCE: Duration = Duration::from_millis(250);

/// The worker thread, joined once.
pub(in crate::service) struct Trainer(Mutex<Option<JoinHandle<()>>>);

struct Worker {
    name: String,
    store: Store,
    clock: Clock,
    board: Arc<ProgressBoard>,
    shutdown: Shutdown,
    pool: TrainingPool,
    threads: usize,
    memory: Memory,
    lease: Duration,
    runtime: Handle,
}

/// How the work on a job ended.
enum JobEnd {
    Finished(JobOutcome),
    /// The work stopped before its end.
    Stopped,
    /// The store failed in a way that may pass.
    Interrupted(StoreError),
    /// Another worker holds the job.
    Fenced,
}

impl Trainer {
    pub(in crate::service) fn start(
        config: &Config,
        store: Store,
        clock: Clock,
        board: Arc<ProgressBoard>,
        memory: Memory,
        shutdown: Shutdown,
    ) -> Result<Self, ServiceError> {
        let pool = TrainingPool::new(config.training_threads).map_err(ServiceError::internal)?;
        let worker = Worker {
            name: identity::new_id("worker")?,
            store,
            clock,
            board,
            shutdown,
            pool,
            threads: config.training_threads,
            memory,
            lease: config.lease,
            runtime: Handle::current(),
        };
        let worker = Arc::new(worker);
        let thread = std::thread::Builder::new().name("trainer".into()).spawn(move || worker.run());
        Ok(Trainer(Mutex::new(Some(thread.map_err(ServiceError::internal)?))))
    }

    /// Waits until the worker has requeued its job. Call after the shutdown has begun.
    pub(in crate::service) async fn join(&self) {
        let thread = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(thread) = thread else { return };
        if !matches!(tokio::task::spawn_blocking(move || thread.join()).await, Ok(Ok(()))) {
            tracing::error!("the training thread panicked");
        }
    }
}

impl Worker {
    fn run(self: Arc<Self>) {
        let mut changes = self.board.subscribe();
        while !self.shutdown.has_begun() {
            changes.mark_unchanged();
            match self.runtime.block_on(self.claim()) {
                Ok(Some(claimed)) => self.work(claimed),
                Ok(None) => self.runtime.block_on(async {
                    tokio::select! {
                        _ = changes.changed() => {}
                        () = self.shutdown.begun() => {}
                        () = tokio::time::sleep(QUEUE_POLL) => {}
                    }
                }),
                Err(error) => self.pause("claiming a job", &error),
            }
        }
    }

    async fn claim(&self) -> Result<Option<ClaimedJob>, StoreError> {
        let lease_seconds = u32::try_from(self.lease.as_secs()).unwrap_or(u32::MAX).max(1);
        let now = self.store.lease_time(self.clock.now_milliseconds()).await?;
        self.store.claim_job(&self.name, lease_seconds, now).await
    }

    fn work(self: &Arc<Self>, claimed: ClaimedJob) {
        let (job, attempt) = (claimed.row.job.clone(), claimed.attempt);
        tracing::info!(job, attempt, steps_done = claimed.row.steps_done, "job started");
        let stop = self.board.enter(&job, claimed.row.steps_done, claimed.row.steps_total);
        let keeper = self.runtime.spawn(keep_lease(
            self.store.clone(),
            self.clock.clone(),
            self.shutdown.clone(),
            (job.clone(), attempt),
            self.lease,
            stop.clone(),
        ));
        let (worker, signal) = (self.clone(), stop.clone());
        let (answer, solved) = mpsc::channel();
        let solving = std::thread::Builder::new().name("job".into()).spawn(move || {
            let ended = catch_unwind(AssertUnwindSafe(|| worker.solve(&claimed, &signal)))
                .unwrap_or_else(|panic| failed(panic_reason(panic.as_ref())));
            // Nobody receives this if the work was abandoned.
            let _ = answer.send(ended);
        });
        let ended = match &solving {
            Ok(_) => until_solved(&solved, &stop),
            Err(error) => failed(format!("no thread: {error}")),
        };
        self.close_at_last(&job, attempt, &ended);
        keeper.abort();
        self.board.leave(&job);
        // The next job would compete with what this one still computes.
        while solving.as_ref().is_ok_and(|thread| !thread.is_finished()) && !self.shutdown.has_begun() {
            self.wait(STOP_POLL);
        }
    }

    /// Ends the job in the store and retries until that succeeds: a full disk must not cost a policy that took hours.
    fn close_at_last(&self, job: &str, attempt: i64, ended: &JobEnd) {
        while let Err(error) = self.close(job, attempt, ended) {
            self.pause("ending a job; trying again", &error);
            if self.shutdown.has_begun() || error.is_fatal() {
                return;
            }
        }
    }

    fn solve(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> JobEnd {
        let solved = match claimed.row.kind {
            JobKind::Train => self.train(claimed, stop),
            JobKind::Evaluate => self.evaluate(claimed, stop),
            JobKind::Backtest => self.backtest(claimed, stop),
            JobKind::Frontier => self.frontier(claimed, stop),
        };
        solved.map_or_else(|ended| ended, JobEnd::Finished)
    }

    /// Waits for the memory of a job. If this process can never provide it, fails the job: it was queued where there is
    /// more.
    fn reserve(&self, estimate: &Footprint) -> Result<Reserved, JobEnd> {
        self.runtime.block_on(self.memory.reserve(estimate)).map_err(|error| failed(error.to_string()))
    }

    fn close(&self, job: &str, attempt: i64, ended: &JobEnd) -> Result<(), StoreError> {
        let now = self.clock.now_milliseconds();
        let held = match ended {
            JobEnd::Finished(outcome) => {
                let held = self.runtime.block_on(self.store.finish_job(job, attempt, outcome.clone(), now))?;
                log_outcome(job, outcome);
                held
            }
            JobEnd::Stopped => {
                tracing::info!(job, "job stopped");
                self.runtime.block_on(self.store.release_job(job, attempt, now))?
            }
            JobEnd::Interrupted(error) => {
                let held = self.runtime.block_on(self.store.release_job(job, attempt, now))?;
                self.pause("keeping a job, which is queued again", error);
                held
            }
            JobEnd::Fenced => false,
        };
        if !held {
            tracing::warn!(job, attempt, "the lease was lost; another worker has the job");
        }
        Ok(())
    }

    fn pause(&self, doing: &str, error: &StoreError) {
        tracing::error!(error = error as &dyn std::error::Error, "the store failed while {doing}");
        self.wait(QUEUE_POLL);
    }

    /// Waits, but not past the shutdown signal.
    fn wait(&self, time: Duration) {
        self.runtime.block_on(async {
            tokio::select! {
                () = self.shutdown.begun() => {}
                () = tokio::time::sleep(time) => {}
            }
        });
    }
}

/// Returns how the work ended; `Stopped` if it runs for [`PATIENCE`] after the stop signal.
fn until_solved(solved: &mpsc::Receiver<JobEnd>, stop: &AtomicBool) -> JobEnd {
    let mut stopped_at = None;
    loop {
        match solved.recv_timeout(STOP_POLL) {
            Ok(ended) => return ended,
            Err(mpsc::RecvTimeoutError::Disconnected) => return JobEnd::Stopped,
            Err(mpsc::RecvTimeoutError::Timeout) if stop.load(Ordering::Relaxed) => {
                if stopped_at.get_or_insert_with(Instant::now).elapsed() >= PATIENCE {
                    return JobEnd::Stopped;
                }
            }
            Err(mpsc::RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Ends a job whose checkpoints could not be read or written: a retry helps if the store was full or busy.
impl From<StoreError> for JobEnd {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Full { .. } | StoreError::Unavailable { .. } => JobEnd::Interrupted(error),
            _ => {
                tracing::error!(error = &error as &dyn std::error::Error, "the store failed during a job");
                failed(error.to_string())
            }
        }
    }
}

/// Ends a job whose training stopped or failed.
impl From<TrainError> for JobEnd {
    fn from(error: TrainError) -> Self {
        match error {
            TrainError::Stopped => JobEnd::Stopped,
            error => failed(error.to_string()),
        }
    }
}

/// Renews the lease and raises `stop` once the job should end: a cancel, a shutdown, or a lost lease.
async fn keep_lease(
    store: Store,
    clock: Clock,
    shutdown: Shutdown,
    (job, attempt): (String, i64),
    lease: Duration,
    stop: Arc<AtomicBool>,
) {
    let lease_milliseconds = i64::try_from(lease.as_millis()).unwrap_or(i64::MAX / 2);
    let mut renewed = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        tokio::select! {
            () = shutdown.begun() => stop.store(true, Ordering::Relaxed),
            () = tokio::time::sleep(CANCEL_POLL.min(lease / 3)) => {}
        }
        if matches!(store.is_to_stop(&job).await, Ok(true)) {
            stop.store(true, Ordering::Relaxed);
        }
        if renewed.elapsed() >= lease / 3 {
            let renewal = async {
                let now = store.lease_time(clock.now_milliseconds()).await?;
                store.renew_lease(&job, attempt, now.saturating_add(lease_milliseconds)).await
            };
            match renewal.await {
                Ok(true) => renewed = Instant::now(),
                Ok(false) => stop.store(true, Ordering::Relaxed),
                Err(error) => tracing::warn!(job, error = &error as &dyn std::error::Error, "lease not renewed"),
            }
        }
    }
}

/// Reads the stored request of a job.
fn requested<T: DeserializeOwned>(claimed: &ClaimedJob) -> Result<T, JobEnd> {
    let read = serde_json::from_str(&claimed.request_json);
    read.map_err(|error| failed(format!("the stored request cannot be read: {error}")))
}

/// Ends a job that made a report.
fn reported(report: &impl Serialize) -> Result<JobOutcome, JobEnd> {
    let report_json = serde_json::to_string(report).map_err(unwritten)?;
    Ok(JobOutcome::Reported { report_json })
}

fn unwritten(error: serde_json::Error) -> JobEnd {
    failed(format!("the report cannot be written as JSON: {error}"))
}

fn failed(reason: String) -> JobEnd {
    JobEnd::Finished(JobOutcome::Failed { reason })
}

fn log_outcome(job: &str, outcome: &JobOutcome) {
    match outcome {
        JobOutcome::Succeeded { policy_id, .. } => tracing::info!(job, policy = policy_id, "job succeeded"),
        JobOutcome::Failed { reason } => tracing::warn!(job, reason, "job failed"),
        JobOutcome::Reported { .. } | JobOutcome::Cancelled => tracing::info!(job, "job ended"),
    }
}

fn panic_reason(panic: &(dyn std::any::Any + Send)) -> String {
    let message = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the job panicked: {}", message.unwrap_or("no message"))
}
