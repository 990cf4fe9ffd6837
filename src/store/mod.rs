//! Floor 2: durable facts. One contract, [`Store`], over SQLite in one file.
//!
//! Promises, strongest first:
//!
//! 1. What was answered is on the disk: a write is answered after its commit and its fsync (`synchronous=FULL`).
//! 2. What is read is what was written, bit for bit: policies, sessions and observations carry a SHA-256 that every read
//!    checks, so a damaged row is [`StoreError::Corrupt`], never an action.
//! 3. A worker whose lease ran out changes nothing: every write of a job names the `attempt` it was claimed under.
//! 4. One process per folder, one writer per process; so opening the folder ends the leases that a dead process left.
//!
//! Conflicts, repeats and gaps are outcomes, not errors. The store reads no clock: time enters as milliseconds since the
//! epoch. Identifiers are opaque and made by the caller.
//!
//! Not done, and why: a digest over the end of a session's observations (a lost tail needs a lost file, which the
//! write-ahead log already detects); deleting old jobs (they are small, and an idempotency key must outlive its request).

mod codec;
mod error;
mod job;
mod job_state;
mod jobs;
mod leases;
mod observations;
mod opening;
mod policies;
mod sessions;
mod writer;

use std::path::Path;

use futures_util::future::BoxFuture;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqlitePool;
use tokio::sync::{mpsc, oneshot, watch};

use error::Failure;
use writer::{Operation, Request};

pub use error::StoreError;
pub use job::{ClaimedJob, CreateJob, JobCounts, JobKind, JobOutcome, JobRow, NewJob};
pub use job_state::{IllegalTransition, JobEvent, JobState};
pub use observations::{Append, NewObservation, ObservationRow};
pub use policies::{DeletePolicy, PolicyRow, PolicySummary};
pub use sessions::{CreateSession, NewSession, SessionRow, SessionSummary};

/// The durable facts of one folder. Clones share the connections, the lock and the writer.
#[derive(Clone)]
pub struct Store {
    readers: SqlitePool,
    requests: mpsc::Sender<Request>,
    /// The first fatal error, from whichever side met it.
    fatal: watch::Sender<Option<StoreError>>,
}

impl Store {
    /// Opens `dir/ballast.sqlite`, creating folder and file, brings its schema up to date and lets every running job be
    /// claimed at once: who ran it no longer can.
    ///
    /// # Errors
    /// [`StoreError::Locked`] where another process holds the folder, [`StoreError::NewerSchema`] where a later release
    /// wrote it, [`StoreError::OldEngine`] where SQLite is older than 3.51.3, else what the disk answered.
    pub async fn open(dir: &Path) -> Result<Store, StoreError> {
        let opening::Opened { lock, writer, readers } = opening::open(dir).await?;
        let (requests, receiver) = mpsc::channel(writer::QUEUE);
        let fatal = watch::Sender::new(None);
        tokio::spawn(writer::serve(writer, receiver, fatal.clone(), lock));
        Ok(Store { readers, requests, fatal })
    }

    /// Whether the store reads and its writer runs.
    pub async fn ping(&self) -> Result<(), StoreError> {
        let doing = "answering a ping";
        self.refuse_after_fatal()?;
        if self.requests.is_closed() {
            return Err(StoreError::Unavailable { doing, source: None });
        }
        self.read(doing, async { Ok(sqlx::query("SELECT 1 FROM jobs").fetch_optional(&self.readers).await?) }).await?;
        Ok(())
    }

    /// Completes once the store failed in a way after which the process must exit (fsync error, damaged file).
    /// Never completes while it is sound.
    pub async fn until_fatal(&self) -> StoreError {
        let mut fatal = self.fatal.subscribe();
        loop {
            if let Some(error) = fatal.borrow_and_update().clone() {
                return error;
            }
            if fatal.changed().await.is_err() {
                std::future::pending::<()>().await;
            }
        }
    }

    /// Commits what waits, closes every connection and gives up the folder. Later calls answer `Unavailable`.
    pub async fn close(&self) {
        self.readers.close().await;
        let (answer, closed) = oneshot::channel();
        if self.requests.send(Request::Close(answer)).await.is_ok() {
            // An error means that the writer ended first: closed as well.
            let _ = closed.await;
        }
    }

    /// Runs `work` in the writer and answers after its commit.
    async fn write<T, W>(&self, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        self.refuse_after_fatal()?;
        let (operation, answer) = Operation::new(doing, work);
        // A writer that ended drops the operation, and the answer with it.
        let _ = self.requests.send(Request::Write(operation)).await;
        match answer.await {
            Ok(result) => result,
            Err(_) => self.refuse_after_fatal().and(Err(StoreError::Unavailable { doing, source: None })),
        }
    }

    /// Names what a read was doing, and remembers a fatal failure.
    async fn read<T>(
        &self,
        doing: &'static str,
        work: impl Future<Output = Result<T, Failure>>,
    ) -> Result<T, StoreError> {
        let result = work.await.map_err(|failure| failure.during(doing));
        if let Err(error) = &result
            && error.is_fatal()
        {
            self.fatal.send_if_modified(|fatal| fatal.is_none() && fatal.replace(error.clone()).is_none());
        }
        result
    }

    fn refuse_after_fatal(&self) -> Result<(), StoreError> {
        self.fatal.borrow().clone().map_or(Ok(()), Err)
    }
}
