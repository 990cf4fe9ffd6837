//! Refreshes the keys from the store at intervals.

use std::sync::Arc;

use crate::service::callers::keys::{KeysInForce, REFRESH};
use crate::service::metrics;
use crate::service::process::shutdown::Shutdown;
use crate::store::StoreError;

/// Refreshes until shutdown begins. Damaged keys are counted at every refresh, so that their alert lasts as long as
/// they do.
pub(in crate::service) async fn keep_fresh(keys: Arc<KeysInForce>, shutdown: Shutdown) {
    loop {
        tokio::select! {
            () = shutdown.begun() => return,
            () = tokio::time::sleep(REFRESH) => {}
        }
        if let Err(error) = keys.refresh().await {
            metrics::count_failure(&error);
            tracing::warn!(
                error = &error as &dyn std::error::Error,
                "reading the keys failed; the last known keys stay in force"
            );
        }
        for what in keys.damaged() {
            metrics::count_failure(&StoreError::Corrupt { what });
        }
    }
}
