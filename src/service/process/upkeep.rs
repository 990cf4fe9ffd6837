//! Background upkeep of the store: deletes expired jobs, and reclaims the space of deleted data.
//!
//! Each step is a short transaction between those of callers. All replicas may do it; they skip what another is working
//! on.

use std::sync::Arc;
use std::time::Duration;

use crate::service::metrics as names;
use crate::service::process::shutdown::Shutdown;
use crate::service::process::timekeeper::Timekeeper;
use crate::store::{Store, StoreError};

/// Time between two checks for expired jobs and free space.
const PAUSE: Duration = Duration::from_secs(60);
/// Time between two steps while there is more to do.
const SHORT_PAUSE: Duration = Duration::from_millis(100);
/// Jobs deleted in one step.
const JOBS: usize = 64;
/// Pages returned in one step: a megabyte.
const PAGES: u32 = 256;
/// Free space in bytes that stays for the next writes.
const FREE_KEPT: u64 = 4 << 20;

/// Keeps the store tidy until the service ends. Without `retain_jobs`, ended jobs stay.
pub(in crate::service) async fn keep_tidy(
    store: Store,
    time: Arc<Timekeeper>,
    retain_jobs: Option<Duration>,
    shutdown: Shutdown,
) {
    let mut is_skewed = false;
    while !shutdown.has_begun() {
        let pause = match step(&store, &time, retain_jobs).await {
            Ok(true) => SHORT_PAUSE,
            Ok(false) => PAUSE,
            Err(error) => {
                tracing::warn!(error = &error as &dyn std::error::Error, "tidying the store failed");
                PAUSE
            }
        };
        let skew_seconds = time.skew_seconds();
        if (skew_seconds != 0) != is_skewed {
            is_skewed = !is_skewed;
            tracing::warn!(
                skew_seconds,
                "the skew of this machine's clock changed; nothing is deleted by age unless it is 0"
            );
        }
        tokio::select! {
            () = shutdown.begun() => {}
            () = tokio::time::sleep(pause) => {}
        }
    }
}

/// Does one step; returns whether there is more to do.
async fn step(store: &Store, time: &Timekeeper, retain_jobs: Option<Duration>) -> Result<bool, StoreError> {
    let expired = match time.time_to_delete_by().await?.zip(retain_jobs) {
        Some((now_ms, retained)) => {
            let retained_ms = i64::try_from(retained.as_millis()).unwrap_or(i64::MAX);
            store.expire_jobs(now_ms.saturating_sub(retained_ms), JOBS).await?
        }
        None => 0,
    };
    if expired > 0 {
        metrics::counter!(names::JOBS_EXPIRED).increment(expired as u64);
    }
    let has_free = store.room().await?.free.is_some_and(|free| free > FREE_KEPT);
    if has_free {
        store.give_back_pages(PAGES).await?;
    }
    Ok(expired == JOBS || has_free)
}
