//! What was done, as an admin asks for it, and how long it is kept.

use std::time::Duration;

use super::clock::Clock;
use super::error::ServiceError;
use super::shutdown::Shutdown;
use crate::store::{AuditBounds, AuditFilter, AuditRow, Store};

/// The audit of the store.
pub struct Audit {
    store: Store,
}

/// How long entries are kept; the newest of a tenant always is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AuditKept {
    pub age: Duration,
    /// Of one tenant.
    pub entries: u32,
}

impl Default for AuditKept {
    /// A year and the time to look at it; a hundred megabytes of one tenant.
    fn default() -> Self {
        AuditKept { age: Duration::from_hours(400 * 24), entries: 250_000 }
    }
}

impl Audit {
    pub(super) fn new(store: Store) -> Self {
        Audit { store }
    }

    /// At most `limit` entries, newest first, after the one with sequence `after`.
    ///
    /// # Errors
    /// The store does not answer, or an entry is not what was written.
    pub async fn list(
        &self,
        filter: &AuditFilter,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<AuditRow>, ServiceError> {
        Ok(self.store.deeds(filter, limit, after).await?)
    }
}

/// Entries past their bounds stay no longer than this.
const ROUND: Duration = Duration::from_hours(1);
/// Between two transactions that drop entries, so that others come between them.
const PAUSE: Duration = Duration::from_secs(1);

/// Drops entries past their bounds until the shutdown begins.
pub(super) async fn keep_bounded(store: Store, clock: Clock, kept: AuditKept, shutdown: Shutdown) {
    let age_ms = i64::try_from(kept.age.as_millis()).unwrap_or(i64::MAX);
    loop {
        let now_ms = clock.now_milliseconds();
        let bounds = AuditBounds { before_ms: now_ms.saturating_sub(age_ms), entries: kept.entries.into() };
        let pause = match store.cut_audit(bounds, now_ms).await {
            Ok(0) => ROUND,
            Ok(dropped) => {
                tracing::info!(dropped, "entries of the audit past their bounds");
                PAUSE
            }
            Err(error) => {
                tracing::warn!(error = &error as &dyn std::error::Error, "the audit is not cut");
                ROUND
            }
        };
        tokio::select! {
            () = shutdown.begun() => return,
            () = tokio::time::sleep(pause) => {}
        }
    }
}
