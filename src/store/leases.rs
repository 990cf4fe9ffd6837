//! Jobs as workers see them: claimed under a lease, checkpointed, finished.
//!
//! A worker holds a job until its lease runs out. Every claim raises `attempt`, and every write names the attempt it was
//! claimed under: a worker that slept past its lease finds itself fenced, by `false`, and must drop the job.

use super::job::{ClaimedJob, JobOutcome};
use super::{Store, StoreError};

impl Store {
    /// Takes the oldest job that is queued, or whose worker's lease ran out, until `now_ms + 1000 lease_seconds`.
    /// A job that was asked to stop is cancelled on the way rather than claimed.
    pub async fn claim_job(
        &self,
        worker: &str,
        lease_seconds: u32,
        now_ms: i64,
    ) -> Result<Option<ClaimedJob>, StoreError> {
        let _ = (worker, lease_seconds, now_ms);
        todo!()
    }

    /// Holds the job until `until_ms`. False when fenced.
    pub async fn renew_lease(&self, job: &str, attempt: i64, until_ms: i64) -> Result<bool, StoreError> {
        let _ = (job, attempt, until_ms);
        todo!()
    }

    /// Stores the solution of one step, replacing an earlier one. False when fenced.
    pub async fn save_checkpoint(
        &self,
        job: &str,
        attempt: i64,
        step: usize,
        bytes: &[u8],
    ) -> Result<bool, StoreError> {
        let _ = (job, attempt, step, bytes);
        todo!()
    }

    /// Every checkpoint of the job, ascending by step, each verified against its digest.
    pub async fn checkpoints(&self, job: &str) -> Result<Vec<(usize, Vec<u8>)>, StoreError> {
        let _ = job;
        todo!()
    }

    /// Stores the result, sets the terminal state and deletes the checkpoints, all or nothing. False when fenced.
    pub async fn finish_job(
        &self,
        job: &str,
        attempt: i64,
        outcome: JobOutcome,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let _ = (job, attempt, outcome, now_ms);
        todo!()
    }

    /// Puts the job back in the queue with its checkpoints; one that was asked to stop is cancelled. False when fenced.
    pub async fn release_job(&self, job: &str, attempt: i64, now_ms: i64) -> Result<bool, StoreError> {
        let _ = (job, attempt, now_ms);
        todo!()
    }
}
