//! Floor 3: durable facts. One contract, [`Store`], over SQLite in a folder or PostgreSQL.
//!
//! Promises, strongest first:
//!
//! 1. An answer is durable: a write is answered after its commit, and the commit after its fsync.
//! 2. Every read returns what was written, bit for bit. Policies, sessions and their entries carry a SHA-256 that every
//!    read checks, so a damaged row gives [`StoreError::Corrupt`], never advice.
//! 3. A worker whose lease ran out changes nothing: every write of a job names the `attempt` it was claimed under.
//! 4. Decisions about one thing are serialized, over all callers. Over SQLite one process holds the folder and has one
//!    writer. Over PostgreSQL each decision first locks the row it depends on; an appended entry needs no lock, because
//!    the table's keys admit only one. Keys are the exception: a [`KeyRing`] adds and revokes them beside the process
//!    that holds the folder, one statement each.
//!
//! Each decision is written once, in `jobs`, `keys`, `leases`, `turns`, `quotas`, `retention`, `policies`, `sessions`,
//! `entries` and `subscriptions`. The engines, in `sqlite` and `postgres`, run statements and commit groups of writes. `error`
//! classifies an engine's errors.
//!
//! Conflicts and repeats are outcomes, not errors. The store reads no clock: time enters as milliseconds since the
//! epoch; leases are measured by [`Store::lease_time`]. Identifiers are opaque and made by the caller.
//!
//! Not done, and why:
//! - A digest over the end of a session's entries. Entries at the end can only be lost with a file, and a write-ahead
//!   log that damage cut short is rejected at startup.
//! - Deleting old sessions and policies by age. The record of an investor is not ours to expire.

mod engine;
mod heartbeat;
mod jobs;
mod labels;
mod maintenance;
mod policies;
mod sessions;
mod subscriptions;
mod tenants;

use std::path::Path;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;

use engine::error::Failure;
use engine::query::{Purpose, Query, StoreConnection, StoreRow};

pub use engine::error::{OverQuota, Quota, StoreError};
pub use engine::postgres::{PostgresUrl, UrlError};
pub use jobs::job::{ClaimedJob, CreateJob, JobCounts, JobKind, JobOutcome, JobRow, NewJob, OldestJobs};
pub use jobs::retention::{DeleteJob, StoreSpace};
pub use jobs::session_trainings::SessionTraining;
pub use jobs::state::{IllegalTransition, JobEvent, JobState};
pub use jobs::training_names::TrainingRequest;
pub use labels::{LONGEST_NAME, LONGEST_NOTES, LONGEST_TAG, Labels, MOST_TAGS, Relabel, given};
pub use maintenance::backup::{Damage, backup, restore};
pub use maintenance::check::Inspection;
pub use maintenance::relocation::relocate;
pub use maintenance::repair::{Repair, repair};
pub use policies::{DeletePolicy, PolicyRow, PolicySummary, Stored};
pub use sessions::attention::{Attention, CareCounts, FirstDay, Today};
pub use sessions::entries::{Append, EntryKind, EntryRow};
pub use sessions::head::Head;
pub use sessions::idempotency::RequestKey;
pub use sessions::initial_account::InitialAccount;
pub use sessions::links::{LinkRow, Linking, MOST_LINKS};
pub use sessions::moving::SessionImport;
pub use sessions::overview::{
    Counted, SessionFilter, SessionKey, SessionList, SessionOrder, SessionPlace, SessionQuery, SessionSummary,
};
pub use sessions::renewals::RenewalTarget;
pub use sessions::row_version::RowVersion;
pub use sessions::words::Labelled;
pub use sessions::{CreateSession, SessionFacts, SessionRow};
pub use subscriptions::deliveries::{ClaimedDelivery, DeliveryEnd, DeliveryLease};
pub use subscriptions::events::{EventKind, NewEvent};
pub use subscriptions::{DeadLetter, MOST_SUBSCRIPTIONS, NewSecret, NewSubscription, Subscribing, SubscriptionRow};
pub use tenants::audit::{Actor, AuditAction, AuditFilter, AuditRow};
pub use tenants::audit_chain::AuditEnd;
pub use tenants::keys::{KeyRing, KeyRole, KeyRoles, KeyRow, NewKey, Rotation, StoredKeys, Successor};
pub use tenants::quotas::{Quotas, Usage};
pub use tenants::tenant::Tenant;

/// The durable facts of one folder or one database. Clones share the connections.
///
/// Waits for a database are boxed: their futures take kilobytes, which every call that may wait would otherwise carry.
/// Most calls over a folder read nothing.
#[derive(Clone)]
pub struct Store {
    engine: Engine,
    /// The actor that the audit records for changes made through this store.
    actor: Actor,
    quotas: Quotas,
}

#[derive(Clone)]
enum Engine {
    Sqlite(engine::sqlite::Folder),
    Postgres(engine::postgres::Database),
}

impl Store {
    /// Opens `dir/ballast.sqlite`, creating the folder and the file, and brings its schema up to date. Every running
    /// job can then be claimed at once, because its worker's process no longer holds the folder.
    ///
    /// # Errors
    /// [`StoreError::Locked`] if another process holds the folder, [`StoreError::NewerSchema`] if a later release wrote
    /// it, [`StoreError::OldEngine`] if SQLite is older than 3.51.3, else the error of the disk.
    pub async fn open(dir: &Path) -> Result<Store, StoreError> {
        Ok(Store::over(Engine::Sqlite(engine::sqlite::Folder::open(dir).await?)))
    }

    /// Connects to a PostgreSQL database and brings its schema up to date. Other processes may use it at the same time,
    /// so leases end by time alone.
    ///
    /// # Errors
    /// [`StoreError::NewerSchema`] if a later release wrote it, else the error of the server.
    pub async fn connect(url: &PostgresUrl) -> Result<Store, StoreError> {
        Ok(Store::over(Engine::Postgres(engine::postgres::Database::connect(url).await?)))
    }

    fn over(engine: Engine) -> Store {
        Store { engine, actor: Actor::service(0), quotas: Quotas::default() }
    }

    /// Returns this store with another actor: the audit attributes each change to `actor`.
    pub fn by(&self, actor: Actor) -> Store {
        Store { actor, ..self.clone() }
    }

    /// Returns this store with these quotas for every tenant.
    pub fn with_quotas(self, quotas: Quotas) -> Store {
        Store { quotas, ..self }
    }

    /// Returns the time by which leases are measured, in milliseconds, if the caller's own clock shows `local_ms`.
    ///
    /// This is PostgreSQL's clock, because the clocks of its clients may differ. A SQLite folder has one process, so
    /// the caller's clock serves. Time passes until the answer is used, which is safe: a lease then ends early, and an
    /// expired lease is noticed late.
    pub async fn lease_time(&self, local_ms: i64) -> Result<i64, StoreError> {
        match &self.engine {
            Engine::Sqlite(_) => Ok(local_ms),
            Engine::Postgres(database) => database.time().await,
        }
    }

    /// Checks that the store can be read and accepts writes.
    pub async fn ping(&self) -> Result<(), StoreError> {
        match &self.engine {
            Engine::Sqlite(folder) => folder.ping().await,
            Engine::Postgres(database) => database.ping().await,
        }
    }

    /// Completes once the store has failed in a way after which the process must exit (fsync error, damaged file).
    /// Never completes while the store is sound, nor over PostgreSQL, whose failures are not this process's.
    pub async fn until_fatal(&self) -> StoreError {
        match &self.engine {
            Engine::Sqlite(folder) => folder.until_fatal().await,
            Engine::Postgres(_) => std::future::pending().await,
        }
    }

    /// Commits waiting writes, closes every connection and releases the folder. Later calls return `Unavailable`.
    pub async fn close(&self) {
        match &self.engine {
            Engine::Sqlite(folder) => folder.close().await,
            Engine::Postgres(database) => database.close().await,
        }
    }

    /// Runs `work` in a transaction and returns after its commit.
    async fn write<T, W>(&self, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(StoreConnection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        match &self.engine {
            Engine::Sqlite(folder) => folder.write(doing, work).await,
            Engine::Postgres(database) => database.write(doing, work).boxed().await,
        }
    }

    /// Runs `work` like [`Self::write`], if it may change rows of `session`.
    async fn write_to<T, W>(&self, session: &str, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(StoreConnection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        match &self.engine {
            Engine::Sqlite(folder) => folder.write_to(session, doing, work).await,
            Engine::Postgres(database) => database.write(doing, work).boxed().await,
        }
    }

    /// Reads the data behind an answer to an investor, by one statement.
    async fn read<T>(
        &self,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[StoreRow]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        self.read_for(Purpose::Advice, doing, query, decode).await
    }

    /// Reads data that is listed, shown or followed, by one statement.
    async fn list<T>(
        &self,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[StoreRow]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        self.read_for(Purpose::Lists, doing, query, decode).await
    }

    /// Reads the condition of the store, the queue or the keys, by one statement.
    async fn probe<T>(
        &self,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[StoreRow]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        self.read_for(Purpose::Probes, doing, query, decode).await
    }

    async fn read_for<T>(
        &self,
        purpose: Purpose,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[StoreRow]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        let rows = match &self.engine {
            Engine::Sqlite(folder) => folder.read(purpose, doing, query).boxed().await?,
            Engine::Postgres(database) => database.read(purpose, doing, query).boxed().await?,
        };
        decode(&rows).map_err(|failure| failure.during(doing))
    }
}
