//! Backward induction: one robust Bellman step after another, from the horizon to the start.  (STUB BODIES)

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::error::TrainError;
use super::policy::{Policy, StepDiagnostics};
use super::specification::Specification;

/// What a running step may be asked and told: the stop signal, and a callback for progress.
pub struct Watch<'a> {
    pub stop: &'a AtomicBool,
    pub progress: &'a (dyn Fn(StepProgress) + Sync),
}

/// How far one backward step is. Called from worker threads, possibly concurrently, at most a few hundred times a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepProgress {
    pub step: usize,
    pub phase: Phase,
    /// Design points solved so far in this step, of `total`.
    pub done: usize,
    pub total: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Solving the robust Bellman step at the design points.
    Solving,
    /// Fitting the surrogates.
    Fitting,
}

/// Everything kept of one solved step; a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepSolution {
    pub step: usize,
    pub diagnostics: StepDiagnostics,
}

/// A prepared training job: the completed specification and its simulated design.
pub struct Training {
    specification: Specification,
}

impl Training {
    /// `specification` must be completed. Cost: simulating the design.
    pub fn new(specification: &Specification) -> Result<Self, TrainError> {
        Ok(Training { specification: specification.clone() })
    }

    /// Number of steps to solve: steps `horizon - 1` down to 0.
    pub fn horizon(&self) -> usize {
        self.specification.problem.horizon
    }

    /// Solves one step given the step after it (`None` at `horizon - 1`). Runs on the current rayon pool.
    /// The result depends on nothing but the specification and `after`.
    pub fn solve_step(
        &self,
        step: usize,
        after: Option<&StepSolution>,
        watch: &Watch,
    ) -> Result<StepSolution, TrainError> {
        let _ = after;
        for done in 0..100 {
            if watch.stop.load(Ordering::Relaxed) {
                return Err(TrainError::Stopped);
            }
            std::thread::sleep(std::time::Duration::from_millis(3));
            (watch.progress)(StepProgress { step, phase: Phase::Solving, done, total: 100 });
        }
        Ok(StepSolution {
            step,
            diagnostics: StepDiagnostics {
                step,
                design_count: 100,
                all_bank_share: 0.9,
                duality_gap: 0.0,
                value: None,
                policy: None,
            },
        })
    }

    /// The policy made of all steps, in ascending order of step.
    pub fn into_policy(self, steps: Vec<StepSolution>) -> Policy {
        Policy::new(self.specification, steps)
    }
}
