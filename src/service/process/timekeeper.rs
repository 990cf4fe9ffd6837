//! The clock that dates everything, and a check that it is right enough to delete by.
//!
//! Replicas follow the clock of their database, so that dates, expiry and deletion by age agree on all of them. A
//! machine whose clock differs from it by more than [`LARGEST_SKEW_MS`] reports that and deletes nothing by age.
//!
//! A folder has only the clock of its machine. That clock is compared with the newest time stored. If they differ by
//! more than [`LONGEST_GAP_MS`], the clock has jumped or the service was stopped for that long. Nothing is deleted by
//! age until the service has run for as long as that.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::service::metrics;
use crate::service::process::clock::Clock;
use crate::store::{Store, StoreError};

const LARGEST_SKEW_MS: i64 = 60_000;
const LONGEST_GAP_MS: i64 = 24 * 60 * 60 * 1000;
/// Shortest time between two stored heartbeats.
const BETWEEN_BEATS_MS: i64 = 5 * 60 * 1000;

/// Compares this machine's clock with the store's.
pub(in crate::service) struct Timekeeper {
    store: Store,
    /// The clock of the machine.
    machine: Clock,
    /// How far the machine's clock is ahead of the database's.
    ahead_ms: Arc<AtomicI64>,
    /// How far it is ahead of its reference; 0 if the difference is tolerated.
    skew_ms: AtomicI64,
    gap: Mutex<Gap>,
}

impl Timekeeper {
    pub(in crate::service) fn new(store: Store, machine: Clock) -> Self {
        let ahead_ms = Arc::new(AtomicI64::new(0));
        Timekeeper { store, machine, ahead_ms, skew_ms: AtomicI64::new(0), gap: Mutex::new(Gap::default()) }
    }

    /// Returns the clock that dates everything.
    pub(in crate::service) fn clock(&self) -> Clock {
        self.machine.behind(self.ahead_ms.clone())
    }

    /// Returns the time to delete by, in milliseconds since 1970; `None` if nothing may be deleted.
    ///
    /// # Errors
    /// The store does not answer.
    pub(in crate::service) async fn time_to_delete_by(&self) -> Result<Option<i64>, StoreError> {
        let before_ms = self.machine.now_milliseconds();
        let (time_ms, skew_ms) = match self.store.database_time().await? {
            Some(database_ms) => {
                let ahead_ms = ahead(before_ms, database_ms, self.machine.now_milliseconds());
                self.ahead_ms.store(ahead_ms, Ordering::Relaxed);
                (database_ms, if ahead_ms.abs() > LARGEST_SKEW_MS { ahead_ms } else { 0 })
            }
            None => (before_ms, self.beside_heartbeat(before_ms).await?),
        };
        self.skew_ms.store(skew_ms, Ordering::Relaxed);
        metrics::record_skew(self.skew_seconds());
        Ok((skew_ms == 0).then_some(time_ms))
    }

    /// Returns how many seconds the clock was ahead of its reference at the last comparison; 0 if it is right enough.
    pub(in crate::service) fn skew_seconds(&self) -> i64 {
        self.skew_ms.load(Ordering::Relaxed) / 1000
    }

    async fn beside_heartbeat(&self, now_ms: i64) -> Result<i64, StoreError> {
        let last_ms = self.store.heartbeat().await?.unwrap_or(i64::MIN);
        let ahead_ms = if last_ms == i64::MIN { 0 } else { now_ms.saturating_sub(last_ms) };
        let skew_ms = self.gap.lock().unwrap_or_else(PoisonError::into_inner).judge(ahead_ms, Instant::now());
        let is_accepted = skew_ms == 0 && ahead_ms.abs() > LONGEST_GAP_MS;
        if last_ms == i64::MIN || is_accepted || (skew_ms == 0 && ahead_ms >= BETWEEN_BEATS_MS) {
            match self.store.beat(now_ms).await {
                // The heartbeat stored before stays as the reference.
                Err(StoreError::Full { .. }) => {}
                stored => stored?,
            }
        }
        Ok(skew_ms)
    }
}

/// Returns how far at least a clock that read `before` and `after` around a reading of another is ahead of that one.
fn ahead(before_ms: i64, other_ms: i64, after_ms: i64) -> i64 {
    if other_ms < before_ms { before_ms.saturating_sub(other_ms) } else { after_ms.saturating_sub(other_ms).min(0) }
}

/// A gap between a clock and the newest time stored, since it was first seen.
#[derive(Default)]
struct Gap {
    since: Option<Instant>,
}

impl Gap {
    /// Returns the gap if it matters: 0 if it is short, or if the clock has since run for the longest gap allowed.
    fn judge(&mut self, ahead_ms: i64, now: Instant) -> i64 {
        if ahead_ms.abs() <= LONGEST_GAP_MS {
            self.since = None;
            return 0;
        }
        let since = *self.since.get_or_insert(now);
        if now.duration_since(since) < Duration::from_millis(LONGEST_GAP_MS.unsigned_abs()) {
            return ahead_ms;
        }
        self.since = None;
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY_MS: i64 = LONGEST_GAP_MS;

    #[test]
    fn a_clock_is_ahead_by_what_a_slow_answer_cannot_explain() {
        assert_eq!(ahead(1_000, 1_500, 2_000), 0);
        assert_eq!(ahead(1_000, 400, 2_000), 600);
        assert_eq!(ahead(1_000, 2_700, 2_000), -700);
    }

    #[test]
    fn a_gap_counts_until_the_clock_has_run_on_for_a_day() {
        let (mut gap, start) = (Gap::default(), Instant::now());
        let after = |hours: u64| start + Duration::from_secs(3600 * hours);
        assert_eq!(gap.judge(DAY_MS, start), 0);
        assert_eq!(gap.judge(500 * DAY_MS, start), 500 * DAY_MS);
        assert_eq!(gap.judge(500 * DAY_MS, after(23)), 500 * DAY_MS);
        assert_eq!(gap.judge(500 * DAY_MS, after(24)), 0);
        // A jump back is a gap also, and one that was corrected is none.
        assert_eq!(gap.judge(-2 * DAY_MS, after(25)), -2 * DAY_MS);
        assert_eq!(gap.judge(10, after(26)), 0);
        assert_eq!(gap.judge(-2 * DAY_MS, after(50)), -2 * DAY_MS);
    }

    #[tokio::test]
    async fn a_folder_whose_clock_jumps_deletes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        let now = Arc::new(AtomicI64::new(1_000_000));
        let keeper = |store: Store| {
            let now = now.clone();
            Timekeeper::new(store, Clock::new(move || now.load(Ordering::Relaxed)))
        };
        let first = keeper(store.clone());
        assert_eq!(first.time_to_delete_by().await.unwrap(), Some(1_000_000));
        now.fetch_add(DAY_MS / 2, Ordering::Relaxed);
        assert_eq!(first.time_to_delete_by().await.unwrap(), Some(1_000_000 + DAY_MS / 2));
        for jump in [500 * DAY_MS, -500 * DAY_MS] {
            now.fetch_add(jump, Ordering::Relaxed);
            for keeper in [&first, &keeper(store.clone())] {
                assert_eq!(keeper.time_to_delete_by().await.unwrap(), None);
                assert_eq!(keeper.skew_seconds(), jump / 1000);
            }
            now.fetch_sub(jump, Ordering::Relaxed);
            assert!(first.time_to_delete_by().await.unwrap().is_some() && first.skew_seconds() == 0);
        }
        store.close().await;
    }
}
