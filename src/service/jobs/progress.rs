//! Progress of running jobs: kept in memory only, because losing it does no harm.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::control::progress::{Phase, StepProgress};

/// Shortest time between two notifications of watchers about progress inside a step.
const SHORTEST_PAUSE: Duration = Duration::from_millis(50);

/// Finished steps needed before time left is estimated, or this share of all steps. The first steps prepare what all
/// use.
const FEWEST_STEPS: f64 = 2.0;
const LEAST_SHARE: f64 = 0.25;

/// Progress of one running job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunningProgress {
    pub steps_done: usize,
    pub steps_total: usize,
    pub current: Option<StepProgress>,
    /// Estimate from the steps finished so far; absent until enough of them are.
    pub seconds_left: Option<f64>,
}

struct RunningJobs {
    stop: Arc<AtomicBool>,
    started: Instant,
    steps_at_start: usize,
    last_wake: Instant,
    progress: RunningProgress,
}

/// The running jobs of this process, and a channel that notifies watchers when anything about any job changes.
pub struct ProgressBoard {
    running: Mutex<HashMap<String, RunningJobs>>,
    bell: watch::Sender<u64>,
}

impl ProgressBoard {
    pub fn new() -> Self {
        ProgressBoard { running: Mutex::new(HashMap::new()), bell: watch::Sender::new(0) }
    }

    /// Returns a receiver that sees a change whenever a job's state or progress changed.
    pub fn subscribe(&self) -> watch::Receiver<u64> {
        self.bell.subscribe()
    }

    /// Notifies every watcher.
    pub fn ring(&self) {
        self.bell.send_modify(|count| *count += 1);
    }

    /// Enters a job that starts with `steps_done` of `steps_total` finished; returns its stop signal.
    pub fn enter(&self, job: &str, steps_done: usize, steps_total: usize) -> Arc<AtomicBool> {
        let stop = Arc::new(AtomicBool::new(false));
        let (now, progress) =
            (Instant::now(), RunningProgress { steps_done, steps_total, current: None, seconds_left: None });
        let running =
            RunningJobs { stop: stop.clone(), started: now, steps_at_start: steps_done, last_wake: now, progress };
        self.lock().insert(job.to_owned(), running);
        self.ring();
        stop
    }

    /// Records how many steps need not be solved again, if that differs from what was stored.
    pub fn resume(&self, job: &str, steps_done: usize) {
        if let Some(running) = self.lock().get_mut(job) {
            running.steps_at_start = steps_done;
            running.progress.steps_done = steps_done;
        }
    }

    /// Records progress inside a step.
    pub fn advance(&self, job: &str, current: StepProgress) {
        let mut wake = false;
        if let Some(running) = self.lock().get_mut(job) {
            running.progress.current = Some(current);
            running.progress.seconds_left = running.seconds_left();
            wake = running.last_wake.elapsed() >= SHORTEST_PAUSE;
            if wake {
                running.last_wake = Instant::now();
            }
        }
        if wake {
            self.ring();
        }
    }

    /// Records a finished step.
    pub fn finish_step(&self, job: &str) {
        if let Some(running) = self.lock().get_mut(job) {
            running.progress.steps_done += 1;
            running.progress.current = None;
            running.progress.seconds_left = running.seconds_left();
        }
        self.ring();
    }

    /// Removes a job that no longer runs here.
    pub fn leave(&self, job: &str) {
        self.lock().remove(job);
        self.ring();
    }

    pub fn of(&self, job: &str) -> Option<RunningProgress> {
        self.lock().get(job).map(|running| running.progress)
    }

    /// Requests that a job stop; does nothing if it does not run here.
    pub fn stop(&self, job: &str) {
        if let Some(running) = self.lock().get(job) {
            running.stop.store(true, Ordering::Relaxed);
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, RunningJobs>> {
        // No code panics while holding the lock, and a map of progress is usable after any interruption.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Default for ProgressBoard {
    fn default() -> Self {
        ProgressBoard::new()
    }
}

impl RunningJobs {
    /// Returns the time per step so far times the steps left. A step being solved counts by its share of finished
    /// design points. Simulation takes another time per step than solving, so there is no estimate for it.
    fn seconds_left(&self) -> Option<f64> {
        let share = match self.progress.current {
            Some(current) if current.phase == Phase::Simulating => return None,
            Some(current) if current.phase == Phase::Fitting => 0.9,
            Some(current) => 0.9 * current.done as f64 / current.total.max(1) as f64,
            None => 0.0,
        };
        let behind = (self.progress.steps_done - self.steps_at_start) as f64 + share;
        let ahead = self.progress.steps_total as f64 - self.progress.steps_done as f64 - share;
        let enough = FEWEST_STEPS.min(LEAST_SHARE * (behind + ahead));
        (behind > 0.0 && behind >= enough).then(|| self.started.elapsed().as_secs_f64() / behind * ahead.max(0.0))
    }
}
