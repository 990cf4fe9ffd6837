//! Floor 2: durable facts. One contract, [`Store`], over SQLite in one file.
//!
//! Promises, strongest first:
//!
//! 1. What was answered is on the disk: a write is answered after its commit and its fsync (`synchronous=FULL`).
//! 2. What is read is what was written, bit for bit: policies, sessions and observations carry a SHA-256 that every read
//!    checks, so a damaged row is [`StoreError::Corrupt`], never an action.
//! 3. A worker whose lease ran out changes nothing: every write of a job names the `attempt` it was claimed under.
//! 4. One process per folder, one writer per process.
//!
//! Conflicts, repeats and gaps are outcomes, not errors. The store reads no clock: time enters as milliseconds since the
//! epoch. Identifiers are opaque and made by the caller.
//!
//! Not done, and why: a digest over the end of a session's observations (a lost tail needs a lost file, which the
//! write-ahead log already detects); deleting old jobs (they are small, and an idempotency key must outlive its request).

mod error;
mod job;
mod job_state;
mod jobs;
mod leases;
mod observations;
mod policies;
mod sessions;

use std::path::Path;

pub use error::StoreError;
pub use job::{ClaimedJob, CreateJob, JobCounts, JobKind, JobOutcome, JobRow, NewJob};
pub use job_state::{IllegalTransition, JobEvent, JobState};
pub use observations::{Append, NewObservation, ObservationRow};
pub use policies::{DeletePolicy, PolicyRow, PolicySummary};
pub use sessions::{CreateSession, NewSession, SessionRow, SessionSummary};

/// The durable facts of one folder. Clones share the connections, the lock and the writer.
#[derive(Clone)]
pub struct Store {}

impl Store {
    /// Opens `dir/ballast.sqlite`, creating folder and file, and brings its schema up to date.
    ///
    /// # Errors
    /// [`StoreError::Locked`] where another process holds the folder, [`StoreError::NewerSchema`] where a later release
    /// wrote it, [`StoreError::OldEngine`] where SQLite is older than 3.51.3, else what the disk answered.
    pub async fn open(dir: &Path) -> Result<Store, StoreError> {
        let _ = dir;
        todo!()
    }

    /// Whether the store reads and its writer runs.
    pub async fn ping(&self) -> Result<(), StoreError> {
        todo!()
    }

    /// Completes once a write failed in a way after which the process must exit (fsync error, corruption).
    /// Never completes while the store is sound.
    pub async fn until_fatal(&self) -> StoreError {
        todo!()
    }

    /// Commits what waits, closes every connection and gives up the folder. Later calls answer `Unavailable`.
    pub async fn close(&self) {
        todo!()
    }
}
