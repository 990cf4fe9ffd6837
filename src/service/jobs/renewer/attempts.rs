//! The progress of a renewal, by the jobs that train its policy.

use serde::Serialize;
use utoipa::ToSchema;

use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::service::sessions::live::LiveSession;
use crate::store::{JobRow, JobState, Store, TrainingRequest};

/// A due renewal and its progress.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RenewalDue {
    /// Number of the renewal.
    pub renewal: usize,
    pub state: RenewalState,
    /// The job that trains the policy, or last did; null before there is one.
    pub job: Option<String>,
    /// The reason why the last job failed; null if it did not fail.
    pub error: Option<String>,
    /// Jobs so far.
    pub attempts: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RenewalState {
    /// Its policy is about to be trained.
    Due,
    /// Its policy is being trained.
    Training,
    /// The last attempt failed; the next one starts by itself. Until then the session keeps its present policy.
    Failed,
    /// Its policy is trained, and the session is about to switch to it.
    Trained,
}

/// The jobs that train the next policy of a session that is due.
pub(super) struct Attempts {
    pub number: usize,
    pub count: usize,
    pub last: Option<JobRow>,
}

impl Attempts {
    pub async fn of(store: &Store, live: &LiveSession) -> Result<Self, ServiceError> {
        let (number, mut last, mut count) = (live.renewals + 1, None, 0);
        while let Some(job) = store.job_by_key(&live.row.tenant, &request(live, number, count).key()).await? {
            (last, count) = (Some(job), count + 1);
        }
        Ok(Attempts { number, count, last })
    }

    fn due(self) -> RenewalDue {
        let state = match self.last.as_ref().map(|job| job.state) {
            None => RenewalState::Due,
            Some(JobState::Queued | JobState::Running) => RenewalState::Training,
            Some(JobState::Failed | JobState::Cancelled) => RenewalState::Failed,
            Some(JobState::Succeeded) => RenewalState::Trained,
        };
        let (job, error) = self.last.map_or((None, None), |row| (Some(row.job), row.error));
        RenewalDue { renewal: self.number, state, job, error, attempts: self.count }
    }
}

/// Returns a session's request for the policy of a renewal.
pub(super) fn request(live: &LiveSession, renewal: usize, attempt: usize) -> TrainingRequest {
    TrainingRequest { session: live.row.session.clone(), renewal, attempt }
}

impl Sessions {
    /// Returns the progress of a session's next renewal; `None` if it is not due.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn renewal(&self, live: &LiveSession) -> Result<Option<RenewalDue>, ServiceError> {
        if !live.is_due() {
            return Ok(None);
        }
        Ok(Some(Attempts::of(&self.store, live).await?.due()))
    }
}
