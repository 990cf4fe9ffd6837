//! Floor 4: use cases: train, open a session, observe, act. No HTTP types.
//!
//! [`Service`] is all that a transport needs: the store, the jobs and their trainer, the prepared policies and the live
//! sessions. Everything acknowledged is in the store first; memory only saves recomputing.

pub mod advice;
pub mod callers;
pub mod catalogue;
pub mod entries;
pub mod error;
pub mod field_bounds;
pub mod jobs;
pub mod letter;
pub mod metrics;
pub mod process;
pub mod sessions;
pub mod subscriptions;

use std::sync::Arc;

use callers::audit::Audit;
use callers::fair_queue::{FairQueue, QueueSize};
use callers::keys::{Caller, KeysInForce};
use catalogue::labels::Names;
use catalogue::policies::Policies;
use error::ServiceError;
use jobs::renewer::Renewer;
use jobs::trainer::Trainer;
use jobs::{Accepted, Jobs};
use letter::links::LinkLookups;
use process::clock::Clock;
use process::config::{Config, Role, StoreLocation, WebhookSettings};
use process::memory::{Memory, Reserved};
use process::shutdown::Shutdown;
use process::timekeeper::Timekeeper;
use sessions::Sessions;
use subscriptions::Subscriptions;
use subscriptions::missing_reports::MissingReports;
use subscriptions::outbox::Outbox;
use subscriptions::sender::{PostWebhook, WebhookSender};

use crate::control::error::FieldError;
use crate::control::evaluation::declared_comparison::Comparison;
use crate::control::request::declared_comparison::{DeclaredComparison, EvaluationQuestion};
use crate::store::{JobCounts, Store, StoreError};

/// The use cases over one store.
pub struct Service {
    pub audit: Audit,
    /// The queue for decoding large bodies.
    pub decoding: FairQueue,
    pub jobs: Jobs,
    pub keys: Arc<KeysInForce>,
    pub names: Names,
    pub policies: Arc<Policies>,
    pub sessions: Sessions,
    pub shutdown: Shutdown,
    pub subscriptions: Subscriptions,
    lookups: LinkLookups,
    memory: Memory,
    store: Store,
    clock: Clock,
    time: Arc<Timekeeper>,
    trainer: Option<Trainer>,
}

impl Service {
    /// Opens the store, and starts the trainer if the role has one.
    ///
    /// # Errors
    /// The role does not fit the store, the store or the training thread cannot be started, or a store that has lost
    /// its keys or must have one holds none. Also if others reach the address and no key would be needed.
    pub async fn start(config: &Config, clock: Clock, shutdown: Shutdown) -> Result<Arc<Self>, ServiceError> {
        let store = match &config.store {
            StoreLocation::Folder(_) if config.role != Role::All => {
                let role = format!("{:?}", config.role).to_lowercase();
                return Err(
                    FieldError::new("role", role, "must be all unless replicas share a PostgreSQL store").into()
                );
            }
            StoreLocation::Folder(folder) => Store::open(folder).await?,
            StoreLocation::Postgres(url) => Store::connect(url).await?,
        };
        let store = store.with_quotas(config.quotas);
        let time = Arc::new(Timekeeper::new(store.clone(), clock));
        // The first comparison of the clocks comes before anything is dated.
        time.time_to_delete_by().await?;
        let clock = time.clock();
        let keys = Arc::new(KeysInForce::load(store.clone(), config.limits.clone(), clock.clone()).await?);
        if keys.are_absent() && !config.allow_anonymous && !config.listen.ip().to_canonical().is_loopback() {
            return Err(ServiceError::NobodyAsked { address: config.listen });
        }
        if keys.are_absent() {
            refuse_lost_keys(&store, config)?;
            tracing::warn!(
                "the store holds no key: every caller is answered, as the tenant default, and may do everything"
            );
        }
        tokio::spawn(callers::key_refresh::keep_fresh(keys.clone(), shutdown.clone()));
        tokio::spawn(process::upkeep::keep_tidy(store.clone(), time.clone(), config.retain_jobs, shutdown.clone()));
        let memory = Memory::new(config.memory_limit);
        tracing::info!(memory_limit_bytes = config.memory_limit.bytes, "memory: {memory}");
        let size = QueueSize { first: config.decode_limit, long: config.long_limit };
        let decoding = FairQueue::new("decode", size, config.turn_wait);
        let threads = config.training_threads;
        let jobs = Jobs::new(store.clone(), clock.clone(), memory.clone(), decoding.clone(), threads);
        let policies = Arc::new(Policies::new(store.clone(), memory.clone(), decoding.clone()));
        let (due, due_names) = tokio::sync::mpsc::channel(jobs::renewer::TOLD);
        let outbox = Outbox::default();
        outbox.refresh(&store).await?;
        let sessions = Sessions::new(config, store.clone(), clock.clone(), policies.clone(), (&memory, &outbox), due);
        let (renewing, queueing) = (sessions.clone(), jobs.clone());
        let renewer = Renewer { store: store.clone(), clock: clock.clone(), sessions: renewing, jobs: queueing };
        tokio::spawn(renewer.run(due_names, shutdown.clone()));
        let audit = Audit::new(store.clone());
        tokio::spawn(callers::audit::keep_bounded(store.clone(), time.clone(), config.retain_audit, shutdown.clone()));
        let start =
            || Trainer::start(config, store.clone(), clock.clone(), jobs.board(), memory.clone(), shutdown.clone());
        let trainer = config.role.runs_jobs().then(start).transpose()?;
        let names = Names::new(store.clone());
        let subscriptions = Subscriptions::new(store.clone(), clock.clone(), outbox, config.webhooks.clone());
        Ok(Arc::new(Service {
            audit,
            decoding,
            jobs,
            keys,
            names,
            policies,
            sessions,
            shutdown,
            subscriptions,
            lookups: LinkLookups::default(),
            memory,
            store,
            clock,
            time,
            trainer,
        }))
    }

    /// Starts to send events, webhooks by `post`, until the service ends.
    pub fn send_webhooks(&self, settings: WebhookSettings, post: PostWebhook) {
        let (store, clock, outbox) = (self.store.clone(), self.clock.clone(), self.sessions.outbox.clone());
        let sender = WebhookSender { store, clock, outbox, settings, post };
        let WebhookSender { store, clock, outbox, settings, .. } = sender.clone();
        tokio::spawn(MissingReports { store, clock, outbox, pause: settings.look }.run(self.shutdown.clone()));
        tokio::spawn(sender.run(self.shutdown.clone()));
    }

    /// Queues an evaluation. The same key and request again return the same job.
    ///
    /// # Errors
    /// A field breaks its rule (for example a policy that is absent or was trained for another problem), or the key was
    /// used with another request.
    pub async fn evaluate(
        &self,
        caller: &Caller,
        question: EvaluationQuestion,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        let request = match question {
            EvaluationQuestion::Investor(request) => *request,
            EvaluationQuestion::Declared(request) => return self.compare(caller, *request, key).await,
        };
        let completed = request.clone().completed()?;
        for (framework, policy) in &completed.policies {
            let advisor = self.policies.advisor(&caller.tenant, policy).await;
            let advisor = advisor.map_err(|error| of_policy(framework.name(), error))?;
            completed.accepts(*framework, advisor.specification())?;
        }
        self.jobs.evaluate(caller, request, key).await
    }

    /// Queues a comparison of policies and rules of a declared problem.
    async fn compare(
        &self,
        caller: &Caller,
        request: DeclaredComparison,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        // Before any policy is read there are as few of them as may be.
        let request = request.completed()?;
        let mut advisors = Vec::with_capacity(request.policies.len());
        for (name, policy) in &request.policies {
            let advisor = self.policies.decider(&caller.tenant, policy).await;
            advisors.push(advisor.map_err(|error| of_policy(name, error))?);
        }
        let read = move || Comparison::new(request, advisors);
        let comparison = self.decoding.run(&caller.tenant, read).await??;
        self.jobs.compare(caller, &comparison, key).await
    }

    /// Resolves if the store fails past recovery. After a failed fsync or an I/O error memory and disk may disagree. So
    /// the process must end: only a restart can find the true state.
    pub async fn store_failed(&self) -> StoreError {
        self.store.until_fatal().await
    }

    /// Succeeds if the store answers and the service is not draining.
    ///
    /// # Errors
    /// Says which of the two does not hold.
    pub async fn ready(&self) -> Result<(), ServiceError> {
        if self.shutdown.is_announced() {
            return Err(ServiceError::Draining);
        }
        Ok(self.store.ping().await?)
    }

    /// Returns how many seconds this machine's clock is ahead of its reference; 0 if it is right enough to delete by.
    pub fn clock_skew_seconds(&self) -> i64 {
        self.time.skew_seconds()
    }

    /// Returns the number of jobs in each state, and the number of sessions.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn counts(&self) -> Result<(JobCounts, u64), ServiceError> {
        Ok((self.store.count_jobs_by_state().await?, self.store.count_sessions().await?))
    }

    /// Returns how many requests wait to be advised, to have a step solved, and to have their body decoded.
    pub fn waiting(&self) -> [(&'static str, usize); 3] {
        let Sessions { advising, resolving, .. } = &self.sessions;
        [advising, resolving, &self.decoding].map(|turns| (turns.name, turns.waiting()))
    }

    /// Waits until the other large answers leave room for so many bytes; `None` if the answer is small.
    ///
    /// # Errors
    /// There is no room in time.
    pub async fn room_for(&self, bytes: usize) -> Result<Option<Reserved>, ServiceError> {
        self.memory.answers(bytes).await
    }

    /// Records what takes memory now.
    pub fn record_memory(&self) {
        self.memory.record(self.sessions.bytes());
    }

    /// Records the age of the oldest jobs and the space that the store takes.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn record_store(&self) -> Result<(), ServiceError> {
        let (oldest, room) = (self.store.oldest_jobs().await?, self.store.room().await?);
        metrics::record_store(oldest, room, self.clock.now_milliseconds());
        Ok(())
    }

    /// Waits for the running job to be requeued and closes the store. Call after the shutdown has begun.
    pub async fn close(&self) {
        if let Some(trainer) = &self.trainer {
            trainer.join().await;
        }
        self.store.close().await;
    }
}

/// Names the policy of an evaluation in an error about it.
fn of_policy(name: &str, error: ServiceError) -> ServiceError {
    let field = format!("policies.{name}");
    match error {
        ServiceError::Unknown { id, .. } => FieldError::new(field, id, "must name a policy").into(),
        ServiceError::Field(FieldError { value, rule, .. }) => FieldError { field, value, rule }.into(),
        other => other,
    }
}

/// Rejects a store without a key that must have one.
///
/// # Errors
/// The store must have a key, or had one, and has none.
fn refuse_lost_keys(store: &Store, config: &Config) -> Result<(), ServiceError> {
    match store.key_mark() {
        Some(mark) => Err(ServiceError::KeysLost { mark }),
        None if config.require_keys => Err(ServiceError::KeysRequired),
        None => Ok(()),
    }
}
