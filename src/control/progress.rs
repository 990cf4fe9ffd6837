//! What long work tells while it runs, and how it is asked to stop.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use crate::control::error::TrainError;

/// What a running step may be asked and told: the stop signal, and a callback for progress.
pub struct Watch<'a> {
    /// Raised to stop the work.
    pub stop: &'a AtomicBool,
    /// Hears how far the work is, from any thread.
    pub progress: &'a (dyn Fn(StepProgress) + Sync),
}

impl Watch<'_> {
    /// Never stopped, and told to nobody.
    pub fn unwatched() -> Watch<'static> {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Watch { stop: &NEVER, progress: &|_| {} }
    }

    /// # Errors
    /// [`TrainError::Stopped`] once the stop signal is up.
    pub fn go_on(&self) -> Result<(), TrainError> {
        if self.stop.load(Ordering::Relaxed) { Err(TrainError::Stopped) } else { Ok(()) }
    }
}

/// How far one backward step is. Reported from worker threads, possibly concurrently, about a hundred times a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepProgress {
    /// The step being solved; 0 in a simulation.
    pub step: usize,
    /// What is being done.
    pub phase: Phase,
    /// Design points solved, or paths simulated, so far in this step, of `total`.
    pub done: usize,
    /// Design points of the step, or paths of the simulation.
    pub total: usize,
}

/// What a job is doing.
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
