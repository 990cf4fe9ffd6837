//! Jobs as users see them: created once, listed, cancelled.

use super::job::{CreateJob, JobCounts, JobRow, NewJob};
use super::{Store, StoreError};

impl Store {
    /// Queues a job and records its idempotency key, both or neither.
    pub async fn create_job(&self, new: NewJob) -> Result<CreateJob, StoreError> {
        let _ = new;
        todo!()
    }

    pub async fn job(&self, job: &str) -> Result<Option<JobRow>, StoreError> {
        let _ = job;
        todo!()
    }

    /// At most `limit` jobs, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn jobs(&self, limit: usize, after: Option<i64>) -> Result<Vec<JobRow>, StoreError> {
        let _ = (limit, after);
        todo!()
    }

    /// Cancels a queued job at once and flags a running one; a terminal job stays as it is. `None` where there is no such
    /// job, else the job as it is now.
    pub async fn request_cancel(&self, job: &str, now_ms: i64) -> Result<Option<JobRow>, StoreError> {
        let _ = (job, now_ms);
        todo!()
    }

    pub async fn count_jobs_by_state(&self) -> Result<JobCounts, StoreError> {
        todo!()
    }
}
