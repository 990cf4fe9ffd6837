//! Jobs as their users see them; each tenant sees only its own.
//!
//! Its modules hold the worker that runs jobs, the progress of jobs, and the renewer, which trains the next policies of
//! sessions.

pub(super) mod due;
mod evaluating;
pub(super) mod idempotency;
pub mod progress;
pub mod renewer;
pub(super) mod trainer;

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use super::error::ServiceError;
use crate::control::estimate;
use crate::control::evaluation::assets::AssetsBacktest;
use crate::control::evaluation::backtest::Backtest;
use crate::control::evaluation::declared_walk::DeclaredWalk;
use crate::control::policy::content_hash;
use crate::control::posed::{Completed, Posed};
use crate::control::request::backtest_assets::BacktestQuestion;
use crate::control::request::frontier::FrontierRequest;
use crate::control::request::warnings::Warning;
use crate::service::callers::fair_queue::FairQueue;
use crate::service::callers::identity;
use crate::service::callers::keys::Caller;
use crate::service::jobs::progress::{ProgressBoard, RunningProgress};
use crate::service::process::clock::Clock;
use crate::service::process::memory::{Large, Memory};
use crate::store::{
    Actor, CreateJob, DeleteJob, JobKind, JobRow, NewJob, Relabel, SessionTraining, Store, Tenant, TrainingRequest,
};

/// A stored job, and its progress if it runs in this process.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedJob {
    pub row: JobRow,
    pub progress: Option<RunningProgress>,
}

/// An accepted job, and what in its request may be a mistake.
#[derive(Debug, Clone, PartialEq)]
pub struct Accepted {
    pub job: TrackedJob,
    pub warnings: Vec<Warning>,
}

/// A request to queue.
struct QueuedRequest<'a, C> {
    kind: JobKind,
    sent: &'a [u8],
    /// The request with every default filled in.
    completed: &'a C,
    steps_total: usize,
    labels: Relabel,
}

impl<'a, C> QueuedRequest<'a, C> {
    /// Builds the request of a job that makes no policy.
    fn of(kind: JobKind, sent: &'a [u8], completed: &'a C, steps_total: usize) -> Self {
        QueuedRequest { kind, sent, completed, steps_total, labels: Relabel::default() }
    }
}

/// The jobs of the store.
#[derive(Clone)]
pub struct Jobs {
    store: Store,
    clock: Clock,
    board: Arc<ProgressBoard>,
    memory: Memory,
    /// The queue for reading the problems of trainings.
    reading: FairQueue,
    /// Threads that a job here runs on.
    threads: usize,
}

impl Jobs {
    pub(super) fn new(store: Store, clock: Clock, memory: Memory, reading: FairQueue, threads: usize) -> Self {
        Jobs { store, clock, board: Arc::new(ProgressBoard::new()), memory, reading, threads }
    }

    pub(super) fn board(&self) -> Arc<ProgressBoard> {
        self.board.clone()
    }

    /// Queues a training whose policy gets `labels`. The same key and specification again return the same job, whatever
    /// the labels are.
    ///
    /// # Errors
    /// A field breaks its rule or needs more memory than there is, or the key was used with another request.
    pub async fn train(
        &self,
        caller: &Caller,
        posed: Posed,
        labels: Relabel,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        labels.check()?;
        let sent = serde_json::to_vec(&posed).map_err(ServiceError::internal)?;
        let jobs = self.clone();
        // Formulas are tried at many points.
        let (completed, warnings) = self.reading.run(&caller.tenant, move || jobs.admitted(posed)).await??;
        let steps_total = completed.step_count();
        let request = QueuedRequest { kind: JobKind::Train, sent: &sent, completed: &completed, steps_total, labels };
        let job = self.queue((&caller.tenant, caller.actor()), request, key).await?;
        Ok(Accepted { job, warnings })
    }

    /// Finds or queues the training that a session requests. All sessions of a tenant that need one policy share its
    /// job. The same request again returns the same job, whatever it trains.
    ///
    /// # Errors
    /// As [`Self::train`].
    pub(super) async fn train_for_session(
        &self,
        tenant: &Tenant,
        posed: Posed,
        labels: Relabel,
        request: TrainingRequest,
    ) -> Result<SessionTraining, ServiceError> {
        let (completed, _) = self.admitted(posed)?;
        let (key, steps_total) = (request.key(), completed.step_count());
        let sent = key.as_bytes();
        let training = QueuedRequest { kind: JobKind::Train, sent, completed: &completed, steps_total, labels };
        let new = self.new_job(tenant, training, None)?;
        let by = Actor::service(self.clock.now_milliseconds());
        let training = self.store.by(by).train_for_session(new, request).await?;
        self.board.ring();
        Ok(training)
    }

    /// Cancels the trainings made for sessions if no session requests them any more.
    ///
    /// # Errors
    /// The store does not answer.
    pub(super) async fn cancel_unrequested(&self) -> Result<(), ServiceError> {
        let now_ms = self.clock.now_milliseconds();
        for job in self.store.by(Actor::service(now_ms)).cancel_unrequested(now_ms).await? {
            tracing::info!(job, "cancelled a training that no session requests any more");
            self.board.stop(&job);
            self.board.ring();
        }
        Ok(())
    }

    /// Completes a problem, if there is memory to train its policy and to advise by it. Returns the warnings with it.
    fn admitted(&self, posed: Posed) -> Result<(Posed, Vec<Warning>), ServiceError> {
        let Completed { posed, training, advising, warnings } = posed.completed(self.threads)?;
        self.memory.admits(&training)?;
        self.memory.keeps(&advising)?;
        Ok((posed, warnings))
    }

    /// Queues a walk-forward. The same key and request again return the same job.
    ///
    /// # Errors
    /// As [`Self::train`].
    pub async fn backtest(
        &self,
        caller: &Caller,
        question: BacktestQuestion,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        let sent = serde_json::to_vec(&question).map_err(ServiceError::internal)?;
        let (completed, estimate, steps, warnings) = match question {
            BacktestQuestion::Asset(request) => {
                let backtest = Backtest::new(request)?;
                let estimate = estimate::backtest(&backtest, self.threads);
                let (steps, warnings) = (backtest.trainings(), backtest.warnings());
                (BacktestQuestion::Asset(backtest.request), estimate, steps, warnings)
            }
            BacktestQuestion::Assets(request) => {
                let backtest = AssetsBacktest::from_request(&request)?;
                let estimate = estimate::backtest_of_assets(&backtest, request.returns().0, self.threads);
                let (steps, warnings) = (backtest.step_count(), backtest.warnings(&request));
                (BacktestQuestion::Assets(request), estimate, steps, warnings)
            }
            BacktestQuestion::Declared(request) => {
                // Formulas are tried at many points.
                let walk = self.reading.run(&caller.tenant, move || DeclaredWalk::new(request)).await??;
                let estimate = walk.footprint(self.threads);
                (BacktestQuestion::Declared(walk.request().clone()), estimate, walk.step_count(), walk.warnings())
            }
        };
        self.memory.admits(&estimate)?;
        let request = QueuedRequest::of(JobKind::Backtest, &sent, &completed, steps);
        let job = self.queue((&caller.tenant, caller.actor()), request, key).await?;
        Ok(Accepted { job, warnings })
    }

    /// Queues a frontier. The same key and request again return the same job.
    ///
    /// # Errors
    /// As [`Self::train`].
    pub async fn frontier(
        &self,
        caller: &Caller,
        request: FrontierRequest,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        let sent = serde_json::to_vec(&request).map_err(ServiceError::internal)?;
        let question = request.question()?;
        self.memory.admits(&estimate::frontier(&question, self.threads))?;
        let of = (&caller.tenant, caller.actor());
        let request = QueuedRequest::of(JobKind::Frontier, &sent, &question.request, 1);
        let job = self.queue(of, request, key).await?;
        Ok(Accepted { job, warnings: question.fund.problem.warnings() })
    }

    fn new_job(
        &self,
        tenant: &Tenant,
        QueuedRequest { kind, sent, completed, steps_total, labels }: QueuedRequest<'_, impl Serialize>,
        idempotency_key: Option<String>,
    ) -> Result<NewJob, ServiceError> {
        Ok(NewJob {
            job: identity::new_id("job")?,
            tenant: tenant.clone(),
            kind,
            request_json: serde_json::to_string(completed).map_err(ServiceError::internal)?,
            request_hash: content_hash(sent),
            idempotency_key,
            steps_total,
            labels,
            created_ms: self.clock.now_milliseconds(),
        })
    }

    /// Queues the completed form of the request that was `sent`.
    async fn queue(
        &self,
        (tenant, by): (&Tenant, Actor),
        request: QueuedRequest<'_, impl Serialize>,
        key: Option<String>,
    ) -> Result<TrackedJob, ServiceError> {
        key.as_deref().map_or(Ok(()), idempotency::check)?;
        let new = self.new_job(tenant, request, key.clone())?;
        match self.store.by(by).create_job(new).await? {
            CreateJob::Created(row) => {
                self.board.ring();
                Ok(self.with_progress(row))
            }
            CreateJob::Repeated(row) => Ok(self.with_progress(row)),
            CreateJob::KeyConflict => Err(ServiceError::KeyConflict { key: key.unwrap_or_default() }),
        }
    }

    /// Returns the report of a succeeded job that makes one, as JSON.
    ///
    /// # Errors
    /// There is no such job, it has no report (yet), or other large answers leave no room for it.
    pub async fn report(&self, tenant: &Tenant, job: &str) -> Result<Large<Vec<u8>>, ServiceError> {
        let unknown = || ServiceError::unknown("report", job);
        let bytes = self.store.report_bytes(tenant, job).await?.ok_or_else(unknown)?;
        let room = self.memory.answers(bytes).await?;
        let report = self.store.report(tenant, job).await?.ok_or_else(unknown)?;
        Ok(Large { value: report.into_bytes(), room })
    }

    /// Returns one job of the tenant.
    ///
    /// # Errors
    /// There is no such job.
    pub async fn get(&self, tenant: &Tenant, job: &str) -> Result<TrackedJob, ServiceError> {
        Ok(self.with_progress(self.of(tenant, job).await?))
    }

    /// Lists at most `limit` jobs, newest first, after the job with sequence `after`.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn list(
        &self,
        tenant: &Tenant,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<TrackedJob>, ServiceError> {
        let rows = self.store.jobs(tenant, limit, after).await?;
        Ok(rows.into_iter().map(|row| self.with_progress(row)).collect())
    }

    /// Requests that a job stop: first durably, then at its worker. Always accepted; an ended job stays as it is.
    ///
    /// # Errors
    /// There is no such job.
    pub async fn cancel(&self, caller: &Caller, job: &str) -> Result<TrackedJob, ServiceError> {
        self.of(&caller.tenant, job).await?;
        let actor = caller.actor();
        let asked_ms = actor.at_ms;
        let row = self.store.by(actor).request_cancel(job, asked_ms).await?;
        let row = row.ok_or_else(|| ServiceError::unknown("job", job))?;
        self.board.stop(job);
        self.board.ring();
        Ok(self.with_progress(row))
    }

    /// Deletes an ended job, its report and its idempotency key. A policy that it made stays.
    ///
    /// # Errors
    /// There is no such job, or it is queued or running.
    pub async fn delete(&self, caller: &Caller, job: &str) -> Result<(), ServiceError> {
        match self.store.by(caller.actor()).delete_job(&caller.tenant, job).await? {
            DeleteJob::Deleted => Ok(()),
            DeleteJob::Absent => Err(ServiceError::unknown("job", job)),
            DeleteJob::NotEnded => Err(ServiceError::JobNotEnded { job: job.to_owned() }),
        }
    }

    /// Returns a receiver that changes whenever a job's state or progress may have changed.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.board.subscribe()
    }

    /// Returns the row if it belongs to the tenant.
    async fn of(&self, tenant: &Tenant, job: &str) -> Result<JobRow, ServiceError> {
        let row = self.store.job(job).await?.filter(|row| row.tenant == *tenant);
        row.ok_or_else(|| ServiceError::unknown("job", job))
    }

    fn with_progress(&self, row: JobRow) -> TrackedJob {
        let progress = self.board.of(&row.job);
        TrackedJob { row, progress }
    }
}
