//! Queueing of evaluations.

use super::{Accepted, Jobs, QueuedRequest};
use crate::control::declared_training::DeclaredTraining;
use crate::control::estimate;
use crate::control::evaluation::declared_comparison::Comparison;
use crate::control::request::evaluation::EvaluationRequest;
use crate::service::callers::keys::Caller;
use crate::service::error::ServiceError;
use crate::store::JobKind;

impl Jobs {
    /// Queues an evaluation of policies that the caller has checked. The same key and request again return the same
    /// job.
    ///
    /// # Errors
    /// As [`Self::train`].
    pub(in crate::service) async fn evaluate(
        &self,
        caller: &Caller,
        request: EvaluationRequest,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        let sent = serde_json::to_vec(&request).map_err(ServiceError::internal)?;
        let completed = request.completed()?;
        self.memory.admits(&estimate::evaluation(&completed, self.threads))?;
        let (of, steps) = ((&caller.tenant, caller.actor()), completed.step_count());
        let request = QueuedRequest::of(JobKind::Evaluate, &sent, &completed, steps);
        let job = self.queue(of, request, key).await?;
        Ok(Accepted { job, warnings: completed.problem.warnings() })
    }

    /// Queues a comparison that the caller has checked. The same key and request again return the same job.
    ///
    /// # Errors
    /// The job needs more memory than there is, or the key was used with another request.
    pub(in crate::service) async fn compare(
        &self,
        caller: &Caller,
        comparison: &Comparison,
        key: Option<String>,
    ) -> Result<Accepted, ServiceError> {
        let request = comparison.request();
        let sent = serde_json::to_vec(request).map_err(ServiceError::internal)?;
        self.memory.admits(&comparison.footprint())?;
        for training in comparison.trainings() {
            self.memory.admits(&estimate::declared::training(training, self.threads).0)?;
        }
        let queued = QueuedRequest::of(JobKind::Evaluate, &sent, request, comparison.step_count());
        let job = self.queue((&caller.tenant, caller.actor()), queued, key).await?;
        let warnings = comparison.trainings().next().map(DeclaredTraining::warnings);
        Ok(Accepted { job, warnings: warnings.unwrap_or_default() })
    }
}
