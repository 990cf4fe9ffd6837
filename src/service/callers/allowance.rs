//! Limits on each tenant: a rate limit for each class of calls, and a limit on concurrent heavy calls.
//!
//! A flood from one tenant is rejected before any work and cannot take the permits of other tenants. Calls that solve
//! need heavy permits, of which one tenant gets at most half. Advice and observations need none.
//!
//! Some calls turn out to be heavy only while they run: advice for a state outside the design, or an observation that
//! needs such advice. So each call carries a [`HeavyPermit`], which is begun before a solve.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use thiserror::Error;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// A class of calls of similar cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Advice, observations, opening and deleting sessions: milliseconds.
    Live,
    /// Robust steps solved on request, jobs queued, policies imported.
    Heavy,
    /// All other calls.
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

/// Limits that an operator sets for all tenants alike.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Calls a second for one tenant, by class in the order of [`Class`]; also the largest burst. 0: no limit.
    pub rates: [u32; 3],
    /// Permits for concurrent heavy calls of all tenants.
    pub heavy: Arc<Semaphore>,
    /// Concurrent heavy calls of one tenant.
    pub heavy_of_one: usize,
    /// Concurrent event streams of one tenant.
    pub streams_of_one: usize,
    /// A stream ends at this age; its client reconnects and resumes.
    pub stream_age: Duration,
}

/// Enough for pages that follow all the jobs they show and programs that follow a few.
const STREAMS_OF_ONE: usize = 256;
/// Long enough that reconnecting costs nothing, short enough that no stream lives for ever.
const STREAM_AGE: Duration = Duration::from_secs(300);

impl Limits {
    pub fn new(rates: [u32; 3], heavy: usize) -> Self {
        Limits {
            rates,
            heavy: Arc::new(Semaphore::new(heavy)),
            heavy_of_one: heavy.div_ceil(2),
            streams_of_one: STREAMS_OF_ONE,
            stream_age: STREAM_AGE,
        }
    }
}

impl Default for Limits {
    /// Limits far above what one process answers on two cores: they stop runaway loops, not users.
    fn default() -> Self {
        Limits::new([50_000, 500, 10_000], 64)
    }
}

/// The remaining allowance of one tenant.
#[derive(Debug)]
pub struct Allowance {
    buckets: [Bucket; 3],
    heavy: [Arc<Semaphore>; 2],
    heavy_of_one: usize,
    streams: Arc<Semaphore>,
    lists: Arc<Semaphore>,
    streams_of_one: usize,
    stream_age: Duration,
    epoch: Instant,
}

/// Why a call is rejected for now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Refused {
    #[error("more than {} {} calls in a second", .1.per_second, .0.name())]
    TooOften(Class, TooMany),
    #[error("the tenant has {most} event streams open, which is its limit")]
    TooManyStreams { most: usize },
    #[error("the service is running as many calls that solve, train or import as its limit allows")]
    NoPlace,
    #[error("the tenant is running as much work of this kind as its limit allows")]
    OwnWork,
}

/// The rejection of a call above the rate limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooMany {
    pub per_second: u32,
    /// Time until the next call is allowed.
    pub wait: Duration,
}

/// The permit of an event stream, released on drop.
#[derive(Debug)]
pub struct StreamPlace {
    _place: OwnedSemaphorePermit,
    /// When the stream has to end.
    pub until: Instant,
}

/// The permits of a heavy call, released on drop.
type HeavyPermits = Vec<OwnedSemaphorePermit>;

impl Allowance {
    pub fn new(limits: &Limits) -> Self {
        Allowance {
            buckets: limits.rates.map(Bucket::new),
            heavy: [Arc::new(Semaphore::new(limits.heavy_of_one)), limits.heavy.clone()],
            heavy_of_one: limits.heavy_of_one,
            streams: Arc::new(Semaphore::new(limits.streams_of_one)),
            lists: Arc::new(Semaphore::new(1)),
            streams_of_one: limits.streams_of_one,
            stream_age: limits.stream_age,
            epoch: Instant::now(),
        }
    }

    /// Takes one call from the rate of the class.
    ///
    /// # Errors
    /// [`Refused::TooOften`].
    pub fn take(&self, class: Class) -> Result<(), Refused> {
        let now = u64::try_from(self.epoch.elapsed().as_nanos()).unwrap_or(u64::MAX / 2);
        self.buckets[class as usize].take(now).map_err(|refused| Refused::TooOften(class, refused))
    }

    /// Acquires a permit for an event stream.
    ///
    /// # Errors
    /// [`Refused::TooManyStreams`].
    pub fn stream(&self) -> Result<StreamPlace, Refused> {
        let place = self.streams.clone().try_acquire_owned();
        let place = place.map_err(|_| Refused::TooManyStreams { most: self.streams_of_one })?;
        Ok(StreamPlace { _place: place, until: Instant::now() + self.stream_age })
    }

    /// Returns the semaphore that lets a tenant read one list of sessions at a time.
    pub(in crate::service) fn lists(&self) -> Arc<Semaphore> {
        self.lists.clone()
    }

    /// Returns how many heavy calls of the tenant may run at a time.
    pub fn heavy_of_one(&self) -> usize {
        self.heavy_of_one
    }

    /// Acquires the permits for a heavy call, the tenant's own first.
    ///
    /// # Errors
    /// No permit of one of the two kinds is free.
    fn places(&self) -> Result<HeavyPermits, Refused> {
        let acquired = self.heavy.iter().zip([Refused::OwnWork, Refused::NoPlace]);
        acquired.map(|(places, refused)| places.clone().try_acquire_owned().map_err(|_| refused)).collect()
    }
}

/// The permits that one call, or one element of a list, needs before it does heavy work. One call of the heavy rate and
/// the permits are each taken once, at the first request. The permits are released on drop.
#[derive(Debug)]
pub struct HeavyPermit {
    allowance: Arc<Allowance>,
    /// Acquired first, so that elements of one list do not take each other's permits.
    lane: Option<Arc<Semaphore>>,
    counted: OnceLock<()>,
    places: OnceLock<HeavyPermits>,
}

impl HeavyPermit {
    pub fn new(allowance: Arc<Allowance>) -> Self {
        HeavyPermit { allowance, lane: None, counted: OnceLock::new(), places: OnceLock::new() }
    }

    /// Builds the turn of a list element. At most as many elements do heavy work at a time as `lane` has permits.
    pub fn in_lane(allowance: Arc<Allowance>, lane: Arc<Semaphore>) -> Self {
        HeavyPermit { lane: Some(lane), ..HeavyPermit::new(allowance) }
    }

    /// Takes the call from the heavy rate, before its body is read.
    ///
    /// # Errors
    /// [`Refused::TooOften`].
    pub fn count(&self) -> Result<(), Refused> {
        if self.counted.get().is_none() {
            self.allowance.take(Class::Heavy)?;
            self.counted.get_or_init(|| ());
        }
        Ok(())
    }

    /// Also acquires the permits, just before heavy work.
    ///
    /// # Errors
    /// [`Refused::TooOften`], or [`Refused::OwnWork`] or [`Refused::NoPlace`] if no permit is free.
    pub async fn begin(&self) -> Result<(), Refused> {
        self.count()?;
        if self.places.get().is_none() {
            let first = match &self.lane {
                Some(lane) => lane.clone().acquire_owned().await.ok(),
                None => None,
            };
            let mut places = self.allowance.places()?;
            places.extend(first);
            self.places.get_or_init(|| places);
        }
        Ok(())
    }
}

/// A token bucket stored as one number: the time at which it is full again, in nanoseconds.
///
/// A call moves that time one interval later, and is rejected if it would lie more than a second ahead. This is the
/// generic cell rate algorithm, ITU-T I.371.
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
        let updated = self.full_at.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |full_at| {
            (next(full_at) <= now + SECOND).then(|| next(full_at))
        });
        updated.map(drop).map_err(|full_at| TooMany {
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

    #[tokio::test]
    async fn a_heavy_call_is_counted_once_and_gives_its_place_up_when_it_ends() {
        let limits = Limits::new([0, 1, 0], 1);
        let allowance = Arc::new(Allowance::new(&limits));
        let turn = HeavyPermit::new(allowance.clone());
        turn.count().unwrap();
        turn.begin().await.unwrap();
        turn.begin().await.unwrap();
        assert!(matches!(HeavyPermit::new(allowance).begin().await, Err(Refused::TooOften(Class::Heavy, _))));
        let other = HeavyPermit::new(Arc::new(Allowance::new(&limits)));
        assert!(matches!(other.begin().await, Err(Refused::NoPlace)));
        drop(turn);
        other.begin().await.unwrap();
    }

    /// Two permits, one of them the tenant's: the second element waits for the first and is not rejected.
    #[tokio::test]
    async fn elements_of_a_list_wait_for_each_other_and_count_one_by_one() {
        let allowance = Arc::new(Allowance::new(&Limits::new([0, 2, 0], 2)));
        let lane = Arc::new(Semaphore::new(1));
        let element = || HeavyPermit::in_lane(allowance.clone(), lane.clone());
        let (first, second) = (element(), element());
        first.begin().await.unwrap();
        let waiting = tokio::spawn(async move { second.begin().await });
        tokio::task::yield_now().await;
        assert!(!waiting.is_finished());
        drop(first);
        waiting.await.unwrap().unwrap();
        assert!(matches!(element().begin().await, Err(Refused::TooOften(Class::Heavy, _))));
    }

    #[test]
    fn a_tenant_gets_half_of_the_heavy_places() {
        let limits = Limits::new([0; 3], 3);
        let (north, south) = (Allowance::new(&limits), Allowance::new(&limits));
        let held = [north.places().unwrap(), north.places().unwrap()];
        assert_eq!(north.places().unwrap_err(), Refused::OwnWork);
        let last = south.places().unwrap();
        assert_eq!(south.places().unwrap_err(), Refused::NoPlace);
        drop(held);
        drop(last);
        assert_eq!(limits.heavy.available_permits(), 3);
    }
}
