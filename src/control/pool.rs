//! The threads that trainings run on.

use rayon::prelude::*;
use thiserror::Error;

/// A pool of threads; work installed on it is spread over them.
pub struct TrainingPool(rayon::ThreadPool);

/// The threads could not be started.
#[derive(Debug, Error)]
#[error("starting {threads} training threads")]
pub struct PoolError {
    threads: usize,
    source: rayon::ThreadPoolBuildError,
}

impl TrainingPool {
    /// # Errors
    /// The system gives no more threads.
    pub fn new(threads: usize) -> Result<Self, PoolError> {
        let built = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("training-{index}"))
            .build()
            .map_err(|source| PoolError { threads, source })?;
        Ok(TrainingPool(built))
    }

    /// Runs `work` on the pool and waits for it.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.0.install(work)
    }
}

/// `work` done on every item, in their order, on the pool this is called from.
pub fn map<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    items.into_par_iter().map(work).collect()
}
