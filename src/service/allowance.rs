//! How much a tenant may ask: so many calls a second of each class, and so many heavy ones at a time.
//!
//! One tenant's flood is refused before any work, and cannot take the turns of another: calls that solve wait for places
//! of their own, of which a tenant gets half at most, and advice and observations need none of them.
//!
//! Some calls are known to be heavy only once they are under way: advice for a state outside the design, an observation
//! that needs such advice. Each call therefore carries a [`HeavyTurn`], and what is about to solve begins it.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use thiserror::Error;
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
    /// Event streams of one tenant open at a time.
    pub streams_of_one: usize,
    /// A stream older than this ends; its client comes back and goes on where it was.
    pub stream_age: Duration,
}

/// A page follows the jobs it shows, a program a few.
const STREAMS_OF_ONE: usize = 256;
/// Long enough that coming back costs nothing, short enough that no stream is for ever.
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
    heavy_of_one: usize,
    streams: Arc<Semaphore>,
    lists: Arc<Semaphore>,
    streams_of_one: usize,
    stream_age: Duration,
    epoch: Instant,
}

/// Why a call has to come back later.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Refused {
    #[error("more than {} {} calls in a second", .1.per_second, .0.name())]
    TooOften(Class, TooMany),
    #[error("the tenant has {most} event streams open, as many as it may")]
    TooManyStreams { most: usize },
    #[error("as many calls that solve, train or import are under way as may be at a time")]
    NoPlace,
    #[error("the tenant has as much work of this kind under way as it may")]
    OwnWork,
}

/// The call was one too many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooMany {
    pub per_second: u32,
    /// When the next may come.
    pub wait: Duration,
}

/// The place of an event stream, given up when dropped.
#[derive(Debug)]
pub struct StreamPlace {
    _place: OwnedSemaphorePermit,
    /// When the stream has to end.
    pub until: Instant,
}

/// The places of a heavy call, given up when dropped.
type Places = Vec<OwnedSemaphorePermit>;

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

    /// Takes one call off the class.
    ///
    /// # Errors
    /// There is none left now.
    pub fn take(&self, class: Class) -> Result<(), TooMany> {
        let now = u64::try_from(self.epoch.elapsed().as_nanos()).unwrap_or(u64::MAX / 2);
        self.buckets[class as usize].take(now)
    }

    /// A place for an event stream.
    ///
    /// # Errors
    /// [`Refused::TooManyStreams`].
    pub fn stream(&self) -> Result<StreamPlace, Refused> {
        let place = self.streams.clone().try_acquire_owned();
        let place = place.map_err(|_| Refused::TooManyStreams { most: self.streams_of_one })?;
        Ok(StreamPlace { _place: place, until: Instant::now() + self.stream_age })
    }

    /// The place of the one list of sessions that the tenant has read at a time.
    pub(super) fn lists(&self) -> Arc<Semaphore> {
        self.lists.clone()
    }

    /// Heavy calls of the tenant that may be under way at a time.
    pub fn heavy_of_one(&self) -> usize {
        self.heavy_of_one
    }

    /// Places for a heavy call, the tenant's own first.
    ///
    /// # Errors
    /// All of either are taken.
    fn places(&self) -> Result<Places, Refused> {
        let taken = self.heavy.iter().zip([Refused::OwnWork, Refused::NoPlace]);
        taken.map(|(places, refused)| places.clone().try_acquire_owned().map_err(|_| refused)).collect()
    }
}

/// What one call, or one element of a list, must take before it does heavy work: one call off the heavy rate and the
/// places, each once, whoever asks first. The places are given up when it is dropped.
#[derive(Debug)]
pub struct HeavyTurn {
    allowance: Arc<Allowance>,
    /// Waited for first: elements of one list do not take each other's places.
    lane: Option<Arc<Semaphore>>,
    counted: OnceLock<()>,
    places: OnceLock<Places>,
}

impl HeavyTurn {
    pub fn new(allowance: Arc<Allowance>) -> Self {
        HeavyTurn { allowance, lane: None, counted: OnceLock::new(), places: OnceLock::new() }
    }

    /// Of an element of a list, of whose elements as many do heavy work at a time as `lane` has places.
    pub fn in_lane(allowance: Arc<Allowance>, lane: Arc<Semaphore>) -> Self {
        HeavyTurn { lane: Some(lane), ..HeavyTurn::new(allowance) }
    }

    /// Takes the call off the heavy rate, before its body is read.
    ///
    /// # Errors
    /// [`Refused::TooOften`].
    pub fn count(&self) -> Result<(), Refused> {
        if self.counted.get().is_none() {
            self.allowance.take(Class::Heavy).map_err(|refused| Refused::TooOften(Class::Heavy, refused))?;
            self.counted.get_or_init(|| ());
        }
        Ok(())
    }

    /// Takes places too: heavy work comes next.
    ///
    /// # Errors
    /// [`Refused::TooOften`], or if all places are taken [`Refused::OwnWork`] or [`Refused::NoPlace`].
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

    #[tokio::test]
    async fn a_heavy_call_is_counted_once_and_gives_its_place_up_when_it_ends() {
        let limits = Limits::new([0, 1, 0], 1);
        let allowance = Arc::new(Allowance::new(&limits));
        let turn = HeavyTurn::new(allowance.clone());
        turn.count().unwrap();
        turn.begin().await.unwrap();
        turn.begin().await.unwrap();
        assert!(matches!(HeavyTurn::new(allowance).begin().await, Err(Refused::TooOften(Class::Heavy, _))));
        let other = HeavyTurn::new(Arc::new(Allowance::new(&limits)));
        assert!(matches!(other.begin().await, Err(Refused::NoPlace)));
        drop(turn);
        other.begin().await.unwrap();
    }

    /// Two places, of which one is the tenant's: the second element waits for the first and is not refused.
    #[tokio::test]
    async fn elements_of_a_list_wait_for_each_other_and_count_one_by_one() {
        let allowance = Arc::new(Allowance::new(&Limits::new([0, 2, 0], 2)));
        let lane = Arc::new(Semaphore::new(1));
        let element = || HeavyTurn::in_lane(allowance.clone(), lane.clone());
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
