//! The progress that long work reports, and its stop signal.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use crate::control::error::TrainError;

/// The watch on a running step: the stop signal, and a callback for progress.
pub struct Watch<'a> {
    /// Raised to stop the work.
    pub stop: &'a AtomicBool,
    /// Called with the progress, from any thread.
    pub progress: &'a (dyn Fn(StepProgress) + Sync),
}

impl Watch<'_> {
    /// Returns a watch that never stops the work and ignores its progress.
    pub fn unwatched() -> Watch<'static> {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Watch { stop: &NEVER, progress: &|_| {} }
    }

    /// Checks the stop signal.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] once the stop signal is raised.
    pub fn go_on(&self) -> Result<(), TrainError> {
        if self.stop.load(Ordering::Relaxed) { Err(TrainError::Stopped) } else { Ok(()) }
    }
}

/// Progress of one backward step. Reported from worker threads, possibly concurrently, about a hundred times a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepProgress {
    /// The step being solved; 0 in a simulation.
    pub step: usize,
    /// The current phase.
    pub phase: Phase,
    /// Design points solved, or paths simulated, so far in this step, of `total`.
    pub done: usize,
    /// Design points of the step, or paths of the simulation.
    pub total: usize,
}

/// The phase of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Solving the robust Bellman step at the design points.
    Solving,
    /// Fitting the surrogates.
    Fitting,
    /// Following strategies through simulated paths.
    Simulating,
}
