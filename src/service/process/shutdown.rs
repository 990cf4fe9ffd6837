//! The signal that ends the service: announced, then begun, never withdrawn.

use tokio::sync::watch;

/// The phases of a shutdown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum ShutdownPhase {
    Serving,
    /// Requests are still answered; load balancers are told to send clients elsewhere.
    Leaving,
    Ending,
}

/// A handle on the signal; clones share it.
#[derive(Clone)]
pub struct Shutdown(watch::Sender<ShutdownPhase>);

impl Shutdown {
    pub fn new() -> Self {
        Shutdown(watch::Sender::new(ShutdownPhase::Serving))
    }

    fn reach(&self, phase: ShutdownPhase) {
        self.0.send_if_modified(|at| {
            let is_later = phase > *at;
            *at = phase.max(*at);
            is_later
        });
    }

    /// Announces that the service will end soon: it reports not ready, and connections close after their next answers.
    pub fn announce(&self) {
        self.reach(ShutdownPhase::Leaving);
    }

    /// Begins the shutdown.
    pub fn begin(&self) {
        self.reach(ShutdownPhase::Ending);
    }

    pub fn is_announced(&self) -> bool {
        *self.0.borrow() >= ShutdownPhase::Leaving
    }

    pub fn has_begun(&self) -> bool {
        *self.0.borrow() == ShutdownPhase::Ending
    }

    /// Resolves once the shutdown has begun.
    pub async fn begun(&self) {
        // The sender lives in `self`, so waiting cannot fail.
        let _ = self.0.subscribe().wait_for(|phase| *phase == ShutdownPhase::Ending).await;
    }
}

impl Default for Shutdown {
    fn default() -> Self {
        Shutdown::new()
    }
}
