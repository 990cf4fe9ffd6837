//! The threads that trainings run on.

use rayon::prelude::*;
use thiserror::Error;

use crate::numerics::machine::interruption;

/// A pool of lowest-priority threads; work installed on it is spread over them.
pub struct TrainingPool(rayon::ThreadPool);

/// The threads could not be started.
#[derive(Debug, Error)]
#[error("could not start {threads} training threads")]
pub struct PoolError {
    threads: usize,
    source: rayon::ThreadPoolBuildError,
}

impl TrainingPool {
    /// Starts the threads.
    ///
    /// # Errors
    /// The system gives no more threads.
    pub fn new(threads: usize) -> Result<Self, PoolError> {
        let built = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("training-{index}"))
            .start_handler(|_| give_way())
            .build()
            .map_err(|source| PoolError { threads, source })?;
        Ok(TrainingPool(built))
    }

    /// Runs `work` on the pool and waits for it.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.0.install(work)
    }
}

/// Sets the lowest priority, 19 by `nice`, for the calling thread. A training uses only idle core time, and delays no
/// request.
fn give_way() {
    // On Linux threads have priorities; elsewhere this would apply to the whole process. If the system refuses,
    // training runs at normal priority.
    if cfg!(target_os = "linux") {
        let _ = rustix::process::setpriority_process(None, LOWEST_PRIORITY);
    }
}

const LOWEST_PRIORITY: i32 = 19;

/// Number of items for each thread between two checkpoints of a watched map.
const ITEMS_BETWEEN: usize = 2;

/// Applies `work` to every item, in order, on the pool this is called from. Watched work passes a checkpoint every few
/// items.
pub fn map<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    let carried = interruption::carried();
    if !carried.is_watched() {
        return items.into_par_iter().map(work).collect();
    }
    let (mut items, mut done) = (items.into_iter(), Vec::new());
    while items.len() > 0 {
        interruption::checkpoint();
        let few: Vec<T> = items.by_ref().take(ITEMS_BETWEEN * rayon::current_num_threads()).collect();
        done.par_extend(few.into_par_iter().map(|item| carried.within(|| work(item))));
    }
    done
}

/// Runs both parts in parallel on the pool this is called from.
pub fn join<A: Send, B: Send>(one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B + Send) -> (A, B) {
    let carried = interruption::carried();
    rayon::join(|| carried.within(one), || carried.within(other))
}

#[cfg(test)]
mod tests {
    use rustix::process::getpriority_process;

    use super::*;

    #[cfg_attr(not(target_os = "linux"), ignore = "only Linux has priorities of threads")]
    #[test]
    fn a_pool_gives_way_and_who_waits_for_it_does_not() {
        let before = getpriority_process(None).unwrap();
        let pool = TrainingPool::new(2).unwrap();
        let priorities = pool.0.broadcast(|_| getpriority_process(None).unwrap());
        assert_eq!(priorities, [LOWEST_PRIORITY; 2]);
        assert_eq!(getpriority_process(None).unwrap(), before);
    }
}
