//! Evaluation jobs: first the trainings, one after another, with a checkpoint at each step; then the simulation, as one
//! step.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::{JobEnd, Worker, failed, reported, requested, unwritten};
use crate::control::cache::Cache;
use crate::control::estimate;
use crate::control::evaluation::declared_comparison::Comparison;
use crate::control::evaluation::paths::{Evaluation, Follower};
use crate::control::evaluation::report::{Costs, EvaluationReport};
use crate::control::policy::Policy;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::declared::DeclaredPolicy;
use crate::control::progress::Watch;
use crate::control::request::declared_comparison::{DeclaredComparison, EvaluationQuestion};
use crate::control::request::framework::Framework;
use crate::store::{ClaimedJob, JobOutcome};

impl Worker {
    pub(super) fn evaluate(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<JobOutcome, JobEnd> {
        let request = match requested(claimed)? {
            EvaluationQuestion::Investor(request) => *request,
            EvaluationQuestion::Declared(request) => return self.compare(claimed, *request, stop),
        };
        let evaluation = Evaluation::new(request).map_err(|error| failed(error.to_string()))?;
        let _reserved = self.reserve(&estimate::evaluation(&evaluation.request, self.threads))?;
        let kept = Cache::new(estimate::kept_by_evaluation(&evaluation.request));
        let evaluation = evaluation.keeping(kept.clone());
        let started = Instant::now();
        let mut followers = Vec::new();
        let mut steps_done = 0;
        for &framework in &evaluation.request.frameworks {
            followers.push(self.follower(claimed, &evaluation, framework, (&mut steps_done, &kept), stop)?);
        }
        let training_seconds = started.elapsed().as_secs_f64();
        self.pool.install(|| self.report(claimed, &evaluation, &followers, training_seconds, stop))
    }

    /// Compares policies and rules of a declared problem. Some of the policies are trained first.
    fn compare(
        &self,
        claimed: &ClaimedJob,
        request: DeclaredComparison,
        stop: &AtomicBool,
    ) -> Result<JobOutcome, JobEnd> {
        let mut advisors = Vec::with_capacity(request.policies.len());
        for id in request.policies.values() {
            let policy: DeclaredPolicy =
                serde_json::from_slice(&self.document(claimed, id)?).map_err(|error| failed(error.to_string()))?;
            let kept = self.memory.kept();
            advisors.push(Arc::new(policy.prepared(kept).map_err(|error| failed(error.to_string()))?));
        }
        let comparison = Comparison::new(request, advisors).map_err(|error| failed(error.to_string()))?;
        let mut trained = Vec::new();
        let mut first = 0;
        for training in comparison.trainings() {
            let policy = self.trained_declared(claimed, training.declared(), first, stop)?;
            first += training.horizon() - 1;
            trained.push(Arc::new(policy.prepared(self.memory.kept()).map_err(|error| failed(error.to_string()))?));
        }
        let _reserved = self.reserve(&comparison.footprint())?;
        let watch = Watch { stop, progress: &|progress| self.board.advance(&claimed.row.job, progress) };
        reported(&self.pool.install(|| comparison.run(trained, &watch))?)
    }

    /// Returns the document of a policy that a job names.
    fn document(&self, claimed: &ClaimedJob, policy: &str) -> Result<Vec<u8>, JobEnd> {
        let row = self.runtime.block_on(self.store.policy(&claimed.row.tenant, policy))?;
        row.map(|row| row.json).ok_or_else(|| failed(format!("the policy {policy} was deleted")))
    }

    /// Returns a framework with its policy: stored, or trained here as the steps of the job after `steps_done`.
    fn follower(
        &self,
        claimed: &ClaimedJob,
        evaluation: &Evaluation,
        framework: Framework,
        (steps_done, kept): (&mut usize, &Cache),
        stop: &AtomicBool,
    ) -> Result<Follower, JobEnd> {
        let request = &evaluation.request;
        let policy = if let Some(id) = request.policies.get(&framework) {
            let document = self.document(claimed, id)?;
            Some(Policy::from_json(&document).map_err(|error| failed(error.to_string()))?)
        } else if request.one_policy_for_all(framework) {
            let specification = request.specification(framework, None);
            let policy = self.trained(claimed, &specification, *steps_done, kept.clone(), stop)?;
            *steps_done += request.problem.horizon;
            Some(policy)
        } else {
            None
        };
        Ok(Follower { framework, advisor: policy.map(|policy| Advisor::with(policy, kept.clone())) })
    }

    fn report(
        &self,
        claimed: &ClaimedJob,
        evaluation: &Evaluation,
        followers: &[Follower],
        training_seconds: f64,
        stop: &AtomicBool,
    ) -> Result<JobOutcome, JobEnd> {
        let started = Instant::now();
        let seconds = || started.elapsed().as_secs_f64();
        let watch = Watch { stop, progress: &|progress| self.board.advance(&claimed.row.job, progress) };
        let outcomes = evaluation.simulate(followers, &watch, &seconds)?;
        let costs = Costs::new(training_seconds, seconds(), &outcomes);
        reported(&EvaluationReport::new(evaluation, followers, &outcomes, costs).map_err(unwritten)?)
    }
}
