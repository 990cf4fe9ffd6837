//! Fair queueing for work that blocks no thread: each tenant runs one call at a time and has one in the common queue.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, timeout_at};

use crate::service::callers::allowance::{Allowance, Refused};
use crate::service::error::ServiceError;

/// A limit on concurrent calls.
#[derive(Clone)]
pub(in crate::service) struct CallTurns {
    places: Arc<Semaphore>,
    wait: Duration,
}

/// The permit of a tenant's call, released on drop.
pub(in crate::service) struct Turn(#[expect(dead_code, reason = "held, not read")] [OwnedSemaphorePermit; 2]);

impl CallTurns {
    pub(in crate::service) fn new(places: usize, wait: Duration) -> Self {
        CallTurns { places: Arc::new(Semaphore::new(places)), wait }
    }

    /// Waits for the other calls of the tenant first, so that it has only one in the common queue.
    ///
    /// # Errors
    /// [`Refused::OwnWork`] if the tenant's other calls did not end in time, [`ServiceError::Busy`] if those of others
    /// did not.
    pub(in crate::service) async fn of(&self, tenant: &Allowance) -> Result<Turn, ServiceError> {
        let end = Instant::now() + self.wait;
        let own = timeout_at(end, tenant.lists().acquire_owned()).await;
        let own = own.map_err(|_| Refused::OwnWork)?.map_err(ServiceError::internal)?;
        let place = timeout_at(end, self.places.clone().acquire_owned()).await;
        Ok(Turn([own, place.map_err(|_| ServiceError::Busy)?.map_err(ServiceError::internal)?]))
    }
}

#[cfg(test)]
mod tests {
    use futures_util::poll;

    use super::*;
    use crate::service::callers::allowance::Limits;

    #[tokio::test]
    async fn a_tenant_has_one_turn_at_a_time_and_another_passes_its_queue() {
        let (turns, [north, south]) =
            (CallTurns::new(1, Duration::from_secs(60)), [(); 2].map(|()| Allowance::new(&Limits::default())));
        let first = turns.of(&north).await.unwrap();
        let mut queue: Vec<_> = (0..3).map(|_| Box::pin(turns.of(&north))).collect();
        for waiting in &mut queue {
            assert!(poll!(waiting).is_pending());
        }
        let mut other = Box::pin(turns.of(&south));
        assert!(poll!(&mut other).is_pending());
        drop(first);
        // The tenant's next call is behind the other tenant's.
        let has_turn = poll!(&mut other);
        assert!(has_turn.is_ready() && poll!(&mut queue[0]).is_pending());
        drop(has_turn);
        let has_turn = poll!(&mut queue[0]);
        assert!(has_turn.is_ready() && poll!(&mut queue[1]).is_pending());
    }

    #[tokio::test]
    async fn who_waits_too_long_is_told_to_come_again() {
        let (turns, [north, south]) =
            (CallTurns::new(1, Duration::from_millis(5)), [(); 2].map(|()| Allowance::new(&Limits::default())));
        let _first = turns.of(&north).await.unwrap();
        assert!(matches!(turns.of(&north).await, Err(ServiceError::Refused(Refused::OwnWork))));
        assert!(matches!(turns.of(&south).await, Err(ServiceError::Busy)));
    }
}
