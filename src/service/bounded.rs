//! Work that requests cause, bounded: a burst waits its turn, and then is told to come back.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;

use super::error::ServiceError;

/// Runs blocking work, so much of it at a time.
#[derive(Clone)]
pub(super) struct Bounded {
    permits: Arc<Semaphore>,
    wait: Duration,
}

impl Bounded {
    pub(super) fn new(permits: usize, wait: Duration) -> Self {
        Bounded { permits: Arc::new(Semaphore::new(permits)), wait }
    }

    /// Runs `work` on a thread that may block. Its place is taken until it ends, even where the caller goes away.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] where no place became free in time; a panic of `work`.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let permit = tokio::time::timeout(self.wait, self.permits.clone().acquire_owned()).await;
        let permit = permit.map_err(|_| ServiceError::Busy)?.map_err(ServiceError::internal)?;
        let working = tokio::task::spawn_blocking(move || {
            let answer = work();
            drop(permit);
            answer
        });
        working.await.map_err(ServiceError::internal)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[tokio::test]
    async fn work_past_the_bound_is_refused_and_done_once_there_is_room() {
        let bounded = Bounded::new(1, Duration::from_millis(20));
        let (release, held) = mpsc::channel::<()>();
        let first = tokio::spawn({
            let bounded = bounded.clone();
            async move { bounded.run(move || held.recv().is_ok()).await }
        });
        while bounded.permits.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        assert!(matches!(bounded.run(|| ()).await, Err(ServiceError::Busy)));
        release.send(()).unwrap();
        assert!(first.await.unwrap().unwrap());
        assert_eq!(bounded.run(|| 7).await.unwrap(), 7);
    }
}
