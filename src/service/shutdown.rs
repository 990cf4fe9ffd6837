//! The one signal that ends the service: announced, then begun, never taken back.

use tokio::sync::watch;

/// How far the end has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Serving,
    /// Everything is answered still; whoever balances callers is told to look elsewhere.
    Leaving,
    Ending,
}

/// A handle on the signal; clones share it.
#[derive(Clone)]
pub struct Shutdown(watch::Sender<Phase>);

impl Shutdown {
    pub fn new() -> Self {
        Shutdown(watch::Sender::new(Phase::Serving))
    }

    fn reach(&self, phase: Phase) {
        self.0.send_if_modified(|at| {
            let is_later = phase > *at;
            *at = phase.max(*at);
            is_later
        });
    }

    /// Says that the service will end soon: it is ready no more, and connections close with their next answers.
    pub fn announce(&self) {
        self.reach(Phase::Leaving);
    }

    /// Raises the signal.
    pub fn begin(&self) {
        self.reach(Phase::Ending);
    }

    pub fn is_announced(&self) -> bool {
        *self.0.borrow() >= Phase::Leaving
    }

    pub fn has_begun(&self) -> bool {
        *self.0.borrow() == Phase::Ending
    }

    /// Resolves once the signal is raised.
    pub async fn begun(&self) {
        // The sender lives in `self`, so waiting cannot fail.
        let _ = self.0.subscribe().wait_for(|phase| *phase == Phase::Ending).await;
    }
}

impl Default for Shutdown {
    fn default() -> Self {
        Shutdown::new()
    }
}
