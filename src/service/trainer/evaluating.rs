//! Evaluation jobs: the trainings first, one after another, with a checkpoint a step; then the simulation, as one step.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::{Ended, Worker, ended_training, failed};
use crate::control::error::TrainError;
use crate::control::estimate;
use crate::control::evaluation::paths::{Evaluation, Follower};
use crate::control::evaluation::report::{Costs, EvaluationReport};
use crate::control::kept::Kept;
use crate::control::policy::Policy;
use crate::control::policy::advisor::Advisor;
use crate::control::progress::Watch;
use crate::control::request::framework::Framework;
use crate::store::{ClaimedJob, JobOutcome, StoreError};

impl Worker {
    pub(super) fn evaluate(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<Ended, StoreError> {
        let request = match serde_json::from_str(&claimed.request_json) {
            Ok(request) => request,
            Err(error) => return Ok(failed(format!("the stored request cannot be read: {error}"))),
        };
        let evaluation = match Evaluation::new(request) {
            Ok(evaluation) => evaluation,
            Err(error) => return Ok(failed(error.to_string())),
        };
        let _reserved = match self.reserve(&estimate::evaluation(&evaluation.request, self.threads)) {
            Ok(reserved) => reserved,
            Err(ended) => return Ok(ended),
        };
        let kept = Kept::new(estimate::kept_by_evaluation(&evaluation.request));
        let evaluation = evaluation.keeping(kept.clone());
        let started = Instant::now();
        let mut followers = Vec::new();
        let mut steps_done = 0;
        for &framework in &evaluation.request.frameworks {
            match self.follower(claimed, &evaluation, framework, (&mut steps_done, &kept), stop)? {
                Ok(follower) => followers.push(follower),
                Err(ended) => return Ok(ended),
            }
        }
        let training_seconds = started.elapsed().as_secs_f64();
        let report = self.pool.install(|| self.report(claimed, &evaluation, &followers, training_seconds, stop));
        Ok(match report {
            Ok(Ok(report_json)) => Ended::Finished(JobOutcome::Reported { report_json }),
            Ok(Err(error)) => failed(format!("the report cannot be written as JSON: {error}")),
            Err(error) => ended_training(&error),
        })
    }

    /// A framework with its policy: stored, or trained here as the steps of the job after `steps_done`.
    fn follower(
        &self,
        claimed: &ClaimedJob,
        evaluation: &Evaluation,
        framework: Framework,
        (steps_done, kept): (&mut usize, &Kept),
        stop: &AtomicBool,
    ) -> Result<Result<Follower, Ended>, StoreError> {
        let request = &evaluation.request;
        let policy = if let Some(id) = request.policies.get(&framework) {
            let Some(row) = self.runtime.block_on(self.store.policy(&claimed.row.tenant, id))? else {
                return Ok(Err(failed(format!("the policy {id} was deleted"))));
            };
            match Policy::from_json(&row.json) {
                Ok(policy) => Some(policy),
                Err(error) => return Ok(Err(failed(error.to_string()))),
            }
        } else if request.one_policy_for_all(framework) {
            let specification = request.specification(framework, None);
            match self.trained(claimed, &specification, *steps_done, kept.clone(), stop)? {
                Ok(policy) => {
                    *steps_done += request.problem.horizon;
                    Some(policy)
                }
                Err(ended) => return Ok(Err(ended)),
            }
        } else {
            None
        };
        Ok(Ok(Follower { framework, advisor: policy.map(|policy| Advisor::with(policy, kept.clone())) }))
    }

    fn report(
        &self,
        claimed: &ClaimedJob,
        evaluation: &Evaluation,
        followers: &[Follower],
        training_seconds: f64,
        stop: &AtomicBool,
    ) -> Result<Result<String, serde_json::Error>, TrainError> {
        let started = Instant::now();
        let seconds = || started.elapsed().as_secs_f64();
        let watch = Watch { stop, progress: &|progress| self.board.advance(&claimed.row.job, progress) };
        let outcomes = evaluation.simulate(followers, &watch, &seconds)?;
        let costs = Costs::new(training_seconds, seconds(), &outcomes);
        Ok(serde_json::to_string(&EvaluationReport::new(evaluation, followers, &outcomes, costs)))
    }
}
