//! What the service does for its store while nobody asks: ended jobs that expire, and the room that deleted things left.
//!
//! A little at a time: each step is a short transaction among those of the callers. Replicas may all do it; they pass
//! over what another is at.

use std::time::Duration;

use super::clock::Clock;
use super::metrics as names;
use super::shutdown::Shutdown;
use crate::store::{Store, StoreError};

/// Between two looks at what expired and what is free.
const PAUSE: Duration = Duration::from_secs(60);
/// Between two steps while there is more to do.
const SHORT_PAUSE: Duration = Duration::from_millis(100);
/// Jobs deleted in one step.
const JOBS: usize = 64;
/// Pages given back in one step: a megabyte.
const PAGES: u32 = 256;
/// Free room that is left for what is written next, in bytes.
const FREE_KEPT: u64 = 4 << 20;

/// Keeps the store tidy until the service ends. Without `retain_jobs` ended jobs stay.
pub(super) async fn keep_tidy(store: Store, clock: Clock, retain_jobs: Option<Duration>, shutdown: Shutdown) {
    while !shutdown.has_begun() {
        let expired_before = retain_jobs.map(|retained| {
            let retained = i64::try_from(retained.as_millis()).unwrap_or(i64::MAX);
            clock.now_milliseconds().saturating_sub(retained)
        });
        let pause = match step(&store, expired_before).await {
            Ok(true) => SHORT_PAUSE,
            Ok(false) => PAUSE,
            Err(error) => {
                tracing::warn!(error = &error as &dyn std::error::Error, "the store was not tidied");
                PAUSE
            }
        };
        tokio::select! {
            () = shutdown.begun() => {}
            () = tokio::time::sleep(pause) => {}
        }
    }
}

/// One step; whether there is more to do.
async fn step(store: &Store, expired_before: Option<i64>) -> Result<bool, StoreError> {
    let expired = match expired_before {
        Some(expired_before) => store.expire_jobs(expired_before, JOBS).await?,
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
