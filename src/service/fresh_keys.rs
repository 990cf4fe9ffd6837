//! Keys as the store has them, looked at again and again.

use std::sync::Arc;

use super::keys::{Keys, REFRESH};
use super::metrics;
use super::shutdown::Shutdown;
use crate::store::StoreError;

/// Refreshes until the shutdown begins. Keys that are damaged are counted for as long as they are, so that their alert does
/// not end before.
pub(super) async fn keep_fresh(keys: Arc<Keys>, shutdown: Shutdown) {
    loop {
        tokio::select! {
            () = shutdown.begun() => return,
            () = tokio::time::sleep(REFRESH) => {}
        }
        if let Err(error) = keys.refresh().await {
            metrics::count_failure(&error);
            tracing::warn!(error = &error as &dyn std::error::Error, "the keys known last stay in force");
        }
        for what in keys.damaged() {
            metrics::count_failure(&StoreError::Corrupt { what });
        }
    }
}
