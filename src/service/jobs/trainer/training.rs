//! Training jobs, and the trainings inside other jobs, with a checkpoint at each step.

use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::{JobEnd, Worker, failed, requested};
use crate::control::cache::Cache;
use crate::control::declared_training::DeclaredTraining;
use crate::control::error::TrainError;
use crate::control::estimate;
use crate::control::policy::declared::DeclaredPolicy;
use crate::control::policy::{Policy, content_hash};
use crate::control::policy_document::PolicyDocument;
use crate::control::posed::Posed;
use crate::control::progress::Watch;
use crate::control::request::declared::DeclaredSpecification;
use crate::control::request::specification::Specification;
use crate::control::solved_step::StepSolution;
use crate::control::training::Training;
use crate::service::metrics as names;
use crate::store::{ClaimedJob, JobOutcome};

impl Worker {
    pub(super) fn train(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<JobOutcome, JobEnd> {
        let document = match requested(claimed)? {
            Posed::Investor(specification) => {
                let _reserved = self.reserve(&estimate::training(&specification, self.threads))?;
                let kept = Cache::new(estimate::kept_by_training(&specification));
                PolicyDocument::Investor(self.trained(claimed, &specification, 0, kept, stop)?.into())
            }
            Posed::Declared(declared) => {
                PolicyDocument::Declared(self.trained_declared(claimed, &declared, 0, stop)?.into())
            }
        };
        let policy_json =
            document.to_json().map_err(|error| failed(format!("the policy cannot be written as JSON: {error}")))?;
        Ok(JobOutcome::Succeeded { policy_id: content_hash(&policy_json), policy_json })
    }

    /// Returns the policy of a declared problem, as [`Self::trained`] does.
    pub(super) fn trained_declared(
        &self,
        claimed: &ClaimedJob,
        declared: &DeclaredSpecification,
        first: usize,
        stop: &AtomicBool,
    ) -> Result<DeclaredPolicy, JobEnd> {
        let training = DeclaredTraining::with(declared, Cache::default()).map_err(TrainError::from)?;
        let _reserved = self.reserve(&estimate::declared::training(&training, self.threads).0)?;
        let kept = Cache::new(estimate::kept_by_training(training.specification()));
        let training = training.keeping(kept);
        let solve = |step: usize, after: Option<&StepSolution>, watch: &Watch| training.solve_step(step, after, watch);
        let steps = self.solved(claimed, 1..training.horizon(), first, &solve, stop)?;
        Ok(DeclaredPolicy::new(&training, steps))
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
        let training = self.pool.install(|| Training::with(specification, kept))?;
        let solve = |step: usize, after: Option<&StepSolution>, watch: &Watch| training.solve_step(step, after, watch);
        let steps = self.solved(claimed, 0..training.horizon(), first, &solve, stop)?;
        Ok(training.into_policy(steps))
    }

    /// Returns the solutions of `steps`, ascending, resumed from the checkpoints. Step s is checkpoint `first + s` of the
    /// job.
    fn solved(
        &self,
        claimed: &ClaimedJob,
        steps: Range<usize>,
        first: usize,
        solve: &SolveStep<'_>,
        stop: &AtomicBool,
    ) -> Result<Vec<StepSolution>, JobEnd> {
        let job = claimed.row.job.as_str();
        let checkpoints = self.runtime.block_on(self.store.checkpoints(job))?;
        let Range { start, end } = steps;
        let mut steps = resumed(first + start..first + end, &checkpoints);
        if first == 0 || !steps.is_empty() {
            self.board.resume(job, first + steps.len());
        }
        for step in (start..end - steps.len()).rev() {
            let watch = Watch { stop, progress: &|progress| self.board.advance(job, progress) };
            let started = Instant::now();
            let solution = self.pool.install(|| solve(step, steps.last(), &watch))?;
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
        Ok(steps)
    }
}

/// Solves a step, given the step after it.
type SolveStep<'a> = dyn Fn(usize, Option<&StepSolution>, &Watch) -> Result<StepSolution, TrainError> + Sync + 'a;

/// Returns the solutions that need not be computed again. These are the checkpoints in `range`, from its end downwards
/// without a gap, in the format of this release.
fn resumed(range: Range<usize>, checkpoints: &[(usize, Vec<u8>)]) -> Vec<StepSolution> {
    let newest_first = checkpoints.iter().rev().filter(|(step, _)| range.contains(step));
    let in_order = newest_first.zip(range.clone().rev()).take_while(|((step, _), expected)| step == expected);
    in_order.map_while(|((_, bytes), _)| StepSolution::from_checkpoint(bytes)).collect()
}
