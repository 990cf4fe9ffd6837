//! How much a tenant may ask: so many calls a second of each class, and so many heavy ones at a time.
//!
//! One tenant's flood is refused before any work, and cannot take the turns of another: calls that solve wait for places
//! of their own, of which a tenant gets half at most, and advice and observations need none of them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Calls that cost alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Advice, observations, sessions opened and deleted: milliseconds.
    Live,
    /// Robust steps solved on request, jobs queued, policies imported.
    Heavy,
    /// The rest.
    Read,
}

impl Class {
    pub fn name(self) -> &'static str {
        match self {
            Class::Live => "live",
            Class::Heavy => "heavy",
            Class::Read => "read",
        }
    }
}

/// What an operator sets for all tenants alike.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Calls a second of one tenant, by class in the order of [`Class`]; as many may come at once. 0: any number.
    pub rates: [u32; 3],
    /// Heavy calls of all tenants under way at a time.
    pub heavy: Arc<Semaphore>,
    /// Those of one tenant.
    pub heavy_of_one: usize,
}

impl Limits {
    pub fn new(rates: [u32; 3], heavy: usize) -> Self {
        Limits { rates, heavy: Arc::new(Semaphore::new(heavy)), heavy_of_one: heavy.div_ceil(2) }
    }
}

impl Default for Limits {
    /// Far above what one process answers on two cores: they stop loops gone wild, not users.
    fn default() -> Self {
        Limits::new([50_000, 500, 10_000], 64)
    }
}

/// What one tenant has left.
#[derive(Debug)]
pub struct Allowance {
    buckets: [Bucket; 3],
    heavy: [Arc<Semaphore>; 2],
    epoch: Instant,
}

/// The call was one too many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooMany {
    pub per_second: u32,
    /// When the next may come.
    pub wait: Duration,
}

/// The places of a heavy call, given up when dropped.
pub type Places = Vec<OwnedSemaphorePermit>;

impl Allowance {
    pub fn new(limits: &Limits) -> Self {
        Allowance {
            buckets: limits.rates.map(Bucket::new),
            heavy: [Arc::new(Semaphore::new(limits.heavy_of_one)), limits.heavy.clone()],
            epoch: Instant::now(),
        }
    }

    /// Takes one call off the class.
    ///
    /// # Errors
    /// There is none left now.
    pub fn take(&self, class: Class) -> Result<(), TooMany> {
        let now = u64::try_from(self.epoch.elapsed().as_nanos()).unwrap_or(u64::MAX / 2);
        self.buckets[class as usize].take(now)
    }

    /// Places for a heavy call, the tenant's own first; `None` where all are taken.
    pub fn places(&self) -> Option<Places> {
        self.heavy.iter().map(|places| places.clone().try_acquire_owned().ok()).collect()
    }
}

/// A bucket of tokens as one number: the time at which it is full again, in nanoseconds.
///
/// A call puts that time off by one interval, and is refused where it would lie more than a second ahead: the generic
/// cell rate algorithm, ITU-T I.371.
#[derive(Debug)]
struct Bucket {
    per_second: u32,
    full_at: AtomicU64,
}

const SECOND: u64 = 1_000_000_000;

impl Bucket {
    fn new(per_second: u32) -> Self {
        Bucket { per_second, full_at: AtomicU64::new(0) }
    }

    fn take(&self, now: u64) -> Result<(), TooMany> {
        let Some(interval) = SECOND.checked_div(self.per_second.into()) else { return Ok(()) };
        let next = |full_at: u64| full_at.max(now) + interval;
        let taken = self.full_at.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |full_at| {
            (next(full_at) <= now + SECOND).then(|| next(full_at))
        });
        taken.map(drop).map_err(|full_at| TooMany {
            per_second: self.per_second,
            wait: Duration::from_nanos(next(full_at).saturating_sub(now + SECOND)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_gives_its_burst_and_then_its_rate() {
        let bucket = Bucket::new(10);
        let given = |now| (0..100).take_while(|_| bucket.take(now).is_ok()).count();
        assert_eq!(given(0), 10);
        let refused = bucket.take(0).unwrap_err();
        assert_eq!(refused, TooMany { per_second: 10, wait: Duration::from_millis(100) });
        assert_eq!(given(SECOND / 10 - 1), 0);
        assert_eq!(given(SECOND / 10), 1);
        assert_eq!(given(SECOND / 2), 4);
        assert_eq!(given(60 * SECOND), 10);
    }

    #[test]
    fn no_rate_is_no_limit() {
        let bucket = Bucket::new(0);
        assert!((0..10_000).all(|_| bucket.take(0).is_ok()));
    }

    #[test]
    fn threads_share_a_bucket_without_gaining_a_call() {
        let bucket = Bucket::new(1000);
        let given: usize = std::thread::scope(|scope| {
            let takers: Vec<_> =
                (0..4).map(|_| scope.spawn(|| (0..1000).filter(|_| bucket.take(0).is_ok()).count())).collect();
            takers.into_iter().map(|taker| taker.join().unwrap()).sum()
        });
        assert_eq!(given, 1000);
    }

    #[test]
    fn a_tenant_gets_half_of_the_heavy_places() {
        let limits = Limits::new([0; 3], 3);
        let (north, south) = (Allowance::new(&limits), Allowance::new(&limits));
        let held = [north.places().unwrap(), north.places().unwrap()];
        assert!(north.places().is_none());
        let last = south.places().unwrap();
        assert!(south.places().is_none());
        drop(held);
        drop(last);
        assert_eq!(limits.heavy.available_permits(), 3);
    }
}
