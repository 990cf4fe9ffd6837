//! Floor 2: durable facts. One contract, [`Store`], over SQLite in a folder or PostgreSQL.
//!
//! Promises, strongest first:
//!
//! 1. What was answered is on the disk: a write is answered after its commit, and the commit after its fsync.
//! 2. What is read is what was written, bit for bit: policies, sessions and their entries carry a SHA-256 that every read
//!    checks, so a damaged row is [`StoreError::Corrupt`], never an action.
//! 3. A worker whose lease ran out changes nothing: every write of a job names the `attempt` it was claimed under.
//! 4. Decisions about one thing follow each other, whoever makes them: over SQLite because one process holds the folder
//!    and has one writer, over PostgreSQL because each decision first locks the row it rests on, or, of an entry that
//!    is appended, because the table's keys admit one. Keys are the exception:
//!    a [`KeyRing`] adds and revokes them beside the process that holds the folder, one statement each.
//!
//! What is decided is written once, in `jobs`, `keys`, `leases`, `turns`, `quotas`, `retention`, `policies`, `sessions` and
//! `entries`; how a statement is run and how a group of writes is committed is the engine's, in `sqlite` and
//! `postgres`; what an engine's error means is said in `error`.
//!
//! Conflicts and repeats are outcomes, not errors. The store reads no clock: time enters as milliseconds since the
//! epoch; leases are measured by [`Store::lease_time`]. Identifiers are opaque and made by the caller.
//!
//! Not done, and why: a digest over the end of a session's entries (a lost tail needs a lost file; a
//! write-ahead log that damage cut short is refused at the start); deleting old sessions and policies by age (an investor's
//! record is not ours to expire).

mod audit;
mod audit_chain;
mod backup;
mod care;
mod check;
mod codec;
mod entries;
mod error;
mod head;
mod heartbeat;
mod idempotency;
mod job;
mod job_state;
mod jobs;
mod key_mark;
mod keys;
mod labels;
mod leases;
mod migrations;
mod overview;
mod policies;
mod postgres;
mod query;
mod quotas;
mod relocation;
mod renewals;
mod repair;
mod retention;
mod search;
mod seen;
mod session_trainings;
mod sessions;
mod sqlite;
mod statement;
mod tenant;
mod training_names;
mod turns;
mod words;

use std::path::Path;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;

use error::Failure;
use query::{Connection, Purpose, Query, Row};

pub use audit::{Actor, AuditFilter, AuditRow, Deed};
pub use audit_chain::AuditEnd;
pub use backup::{Damage, backup, restore};
pub use care::{Care, CareCounts, FirstDay, Today};
pub use check::Inspection;
pub use entries::{Append, EntryKind, EntryRow};
pub use error::{OverQuota, Quota, StoreError};
pub use head::Head;
pub use idempotency::RequestKey;
pub use job::{ClaimedJob, CreateJob, JobCounts, JobKind, JobOutcome, JobRow, NewJob, OldestJobs};
pub use job_state::{IllegalTransition, JobEvent, JobState};
pub use keys::{KeyRing, KeyRole, KeyRoles, KeyRow, NewKey, Rotate, StoredKeys, Successor};
pub use labels::{LONGEST_NAME, LONGEST_NOTES, LONGEST_TAG, Labels, MOST_TAGS, Relabel, given};
pub use overview::{
    Counted, SessionIs, SessionKey, SessionList, SessionOrder, SessionPlace, SessionQuery, SessionSummary,
};
pub use policies::{DeletePolicy, PolicyRow, PolicySummary, Stored};
pub use postgres::{PostgresUrl, UrlError};
pub use quotas::{Quotas, Usage};
pub use relocation::relocate;
pub use renewals::Onto;
pub use repair::{Repair, repair};
pub use retention::{DeleteJob, Room};
pub use seen::Seen;
pub use session_trainings::SessionTraining;
pub use sessions::{CreateSession, SessionFacts, SessionRow};
pub use tenant::Tenant;
pub use training_names::TrainingRequest;
pub use words::Labelled;

/// The durable facts of one folder or one database. Clones share the connections.
///
/// What waits for a database is boxed: it takes kilobytes, which every call that may wait would carry along, though most
/// calls over a folder read nothing.
#[derive(Clone)]
pub struct Store {
    engine: Engine,
    /// Whose changes are made through it, as the audit has them.
    actor: Actor,
    quotas: Quotas,
}

#[derive(Clone)]
enum Engine {
    Sqlite(sqlite::Folder),
    Postgres(postgres::Database),
}

impl Store {
    /// Opens `dir/ballast.sqlite`, creating folder and file, brings its schema up to date and lets every running job be
    /// claimed at once: who ran it no longer can.
    ///
    /// # Errors
    /// [`StoreError::Locked`] where another process holds the folder, [`StoreError::NewerSchema`] where a later release
    /// wrote it, [`StoreError::OldEngine`] where SQLite is older than 3.51.3, else what the disk answered.
    pub async fn open(dir: &Path) -> Result<Store, StoreError> {
        Ok(Store::over(Engine::Sqlite(sqlite::Folder::open(dir).await?)))
    }

    /// Connects to a PostgreSQL database and brings its schema up to date. Other processes may use it at the same time:
    /// leases end by time alone.
    ///
    /// # Errors
    /// [`StoreError::NewerSchema`] where a later release wrote it, else what the server answered.
    pub async fn connect(url: &PostgresUrl) -> Result<Store, StoreError> {
        Ok(Store::over(Engine::Postgres(postgres::Database::connect(url).await?)))
    }

    fn over(engine: Engine) -> Store {
        Store { engine, actor: Actor::service(0), quotas: Quotas::default() }
    }

    /// The same store, changed by `actor`: each change is written into the audit as his.
    pub fn by(&self, actor: Actor) -> Store {
        Store { actor, ..self.clone() }
    }

    /// The same store, where every tenant may keep so much.
    pub fn with_quotas(self, quotas: Quotas) -> Store {
        Store { quotas, ..self }
    }

    /// The time by which leases are measured, in milliseconds, where the caller's own clock shows `local_ms`.
    ///
    /// PostgreSQL's clock, since those of its clients may differ; a SQLite folder has one process, and that its own.
    /// Time passes until the answer is used, which is safe: a lease then ends early, and one that ran out is seen late.
    pub async fn lease_time(&self, local_ms: i64) -> Result<i64, StoreError> {
        match &self.engine {
            Engine::Sqlite(_) => Ok(local_ms),
            Engine::Postgres(database) => database.time().await,
        }
    }

    /// Whether the store reads and writes.
    pub async fn ping(&self) -> Result<(), StoreError> {
        match &self.engine {
            Engine::Sqlite(folder) => folder.ping().await,
            Engine::Postgres(database) => database.ping().await,
        }
    }

    /// Completes once the store failed in a way after which the process must exit (fsync error, damaged file).
    /// Never completes while it is sound, nor over PostgreSQL, whose failures are not this process's.
    pub async fn until_fatal(&self) -> StoreError {
        match &self.engine {
            Engine::Sqlite(folder) => folder.until_fatal().await,
            Engine::Postgres(_) => std::future::pending().await,
        }
    }

    /// Commits what waits, closes every connection and gives up the folder. Later calls answer `Unavailable`.
    pub async fn close(&self) {
        match &self.engine {
            Engine::Sqlite(folder) => folder.close().await,
            Engine::Postgres(database) => database.close().await,
        }
    }

    /// Runs `work` in a transaction and answers after its commit.
    async fn write<T, W>(&self, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(Connection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        match &self.engine {
            Engine::Sqlite(folder) => folder.write(doing, work).await,
            Engine::Postgres(database) => database.write(doing, work).boxed().await,
        }
    }

    /// As [`Self::write`], where `work` may change rows of `session`.
    async fn write_to<T, W>(&self, session: &str, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(Connection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        match &self.engine {
            Engine::Sqlite(folder) => folder.write_to(session, doing, work).await,
            Engine::Postgres(database) => database.write(doing, work).boxed().await,
        }
    }

    /// Reads what an answer to an investor rests on, by one statement.
    async fn read<T>(
        &self,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[Row]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        self.read_for(Purpose::Advice, doing, query, decode).await
    }

    /// Reads what is listed, shown or followed, by one statement.
    async fn list<T>(
        &self,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[Row]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        self.read_for(Purpose::Lists, doing, query, decode).await
    }

    /// Reads what tells how the store, the queue and the keys are, by one statement.
    async fn probe<T>(
        &self,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[Row]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        self.read_for(Purpose::Probes, doing, query, decode).await
    }

    async fn read_for<T>(
        &self,
        purpose: Purpose,
        doing: &'static str,
        query: Query,
        decode: impl FnOnce(&[Row]) -> Result<T, Failure>,
    ) -> Result<T, StoreError> {
        let rows = match &self.engine {
            Engine::Sqlite(folder) => folder.read(purpose, doing, query).boxed().await?,
            Engine::Postgres(database) => database.read(purpose, doing, query).boxed().await?,
        };
        decode(&rows).map_err(|failure| failure.during(doing))
    }
}
