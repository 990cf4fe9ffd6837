//! Training jobs, and the trainings inside other jobs, with a checkpoint at each step.

use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::{JobEnd, Worker, failed};
use crate::control::cache::Cache;
use crate::control::estimate;
use crate::control::policy::{Policy, content_hash};
use crate::control::progress::Watch;
use crate::control::request::specification::Specification;
use crate::control::solved_step::StepSolution;
use crate::control::training::Training;
use crate::service::metrics as names;
use crate::store::{ClaimedJob, JobOutcome};

impl Worker {
    pub(super) fn train(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<JobOutcome, JobEnd> {
        let specification: Specification = serde_json::from_str(&claimed.request_json)
            .map_err(|error| failed(format!("the stored specification cannot be read: {error}")))?;
        let _reserved = self.reserve(&estimate::training(&specification, self.threads))?;
        let kept = Cache::new(estimate::kept_by_training(&specification));
        let policy = self.trained(claimed, &specification, 0, kept, stop)?;
        let policy_json =
            policy.to_json().map_err(|error| failed(format!("the policy cannot be written as JSON: {error}")))?;
        Ok(JobOutcome::Succeeded { policy_id: content_hash(&policy_json), policy_json })
    }

    /// Returns the policy of a specification, resumed from the checkpoints. Step s is checkpoint `first + s` of the
    /// job, whose checkpoints below `first` are all there. `Err` is how the job ends instead.
    pub(super) fn trained(
        &self,
        claimed: &ClaimedJob,
        specification: &Specification,
        first: usize,
        kept: Cache,
        stop: &AtomicBool,
    ) -> Result<Policy, JobEnd> {
        let job = claimed.row.job.as_str();
        let training = self.pool.install(|| Training::with(specification, kept))?;
        let checkpoints = self.runtime.block_on(self.store.checkpoints(job))?;
        let mut steps = resumed(first..first + training.horizon(), &checkpoints);
        if first == 0 || !steps.is_empty() {
            self.board.resume(job, first + steps.len());
        }
        for step in (0..training.horizon() - steps.len()).rev() {
            let watch = Watch { stop, progress: &|progress| self.board.advance(job, progress) };
            let started = Instant::now();
            let solution = self.pool.install(|| training.solve_step(step, steps.last(), &watch))?;
            metrics::histogram!(names::TRAINING_STEP_SECONDS).record(started.elapsed().as_secs_f64());
            let bytes = solution
                .to_checkpoint()
                .map_err(|error| failed(format!("step {step}: the solution cannot be written as JSON: {error}")))?;
            let saving = self.store.save_checkpoint(job, claimed.attempt, first + step, &bytes);
            if !self.runtime.block_on(saving)? {
                return Err(JobEnd::Fenced);
            }
            steps.push(solution);
            self.board.finish_step(job);
        }
        steps.reverse();
        Ok(training.into_policy(steps))
    }
}

/// Returns the solutions that need not be computed again. These are the checkpoints in `range`, from its end downwards
/// without a gap, in the format of this release.
fn resumed(range: Range<usize>, checkpoints: &[(usize, Vec<u8>)]) -> Vec<StepSolution> {
    let newest_first = checkpoints.iter().rev().filter(|(step, _)| range.contains(step));
    let in_order = newest_first.zip(range.clone().rev()).take_while(|((step, _), expected)| step == expected);
    in_order.map_while(|((_, bytes), _)| StepSolution::from_checkpoint(bytes)).collect()
}
