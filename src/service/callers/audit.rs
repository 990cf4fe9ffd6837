//! The audit as an admin reads it, and how long its entries are kept.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use crate::service::error::ServiceError;
use crate::service::process::shutdown::Shutdown;
use crate::service::process::timekeeper::Timekeeper;
use crate::store::{AuditEnd, AuditFilter, AuditRow, Store, Tenant};

/// The audit of the store.
pub struct Audit {
    store: Store,
}

impl Audit {
    pub(in crate::service) fn new(store: Store) -> Self {
        Audit { store }
    }

    /// Lists at most `limit` entries, newest first, after the one with sequence `after`.
    ///
    /// # Errors
    /// The store does not answer, or an entry differs from what was written.
    pub async fn list(
        &self,
        filter: &AuditFilter,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<AuditRow>, ServiceError> {
        Ok(self.store.deeds(filter, limit, after).await?)
    }
}

/// Time between two deletions of entries past the retention age.
const ROUND: Duration = Duration::from_hours(1);

/// Deletes entries past the retention age and logs where each chain ends, until shutdown begins. A manual change of the
/// database, seals included, does not change what the log recorded.
pub(in crate::service) async fn keep_bounded(store: Store, time: Arc<Timekeeper>, age: Duration, shutdown: Shutdown) {
    let age_ms = i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
    let mut logged = HashMap::new();
    loop {
        let cut = async {
            match time.time_to_delete_by().await? {
                Some(now_ms) => store.cut_audit(now_ms.saturating_sub(age_ms), now_ms).await,
                None => Ok(0),
            }
        };
        match cut.await {
            Ok(0) => {}
            Ok(dropped) => tracing::info!(dropped, "deleted audit entries past their age"),
            Err(error) => tracing::warn!(error = &error as &dyn std::error::Error, "deleting old audit entries failed"),
        }
        match store.audit_ends().await {
            Ok(ends) => log_ends(ends, &mut logged),
            Err(error) => {
                tracing::warn!(error = &error as &dyn std::error::Error, "the ends of the audit were not read");
            }
        }
        tokio::select! {
            () = shutdown.begun() => return,
            () = tokio::time::sleep(ROUND) => {}
        }
    }
}

/// Logs each end that differs from the one `logged` last.
fn log_ends(ends: Vec<AuditEnd>, logged: &mut HashMap<(Tenant, String), i64>) {
    for AuditEnd { tenant, chain, number, seal } in ends {
        if logged.insert((tenant.clone(), chain.clone()), number) != Some(number) {
            tracing::info!(%tenant, chain, number, seal, "the audit ends");
        }
    }
}
