//! The cache, bounded in bytes: bridges, factors, levels of caution and prepared policies share one bound.
//!
//! Every entry can be computed again to the same bits from its [`Key`], so dropping it costs time and nothing else.
//! Bridges depend on sample size, number of paths and seed alone, and a factor on its design and scales alone, so
//! policies that need equal ones share them. A caller that needs an entry which another is computing waits for that
//! one. Entries being computed also count, against a bound of their own, because computing many large ones at once
//! takes as much memory as keeping them.

use std::any::Any;
use std::collections::BTreeMap;
use std::future::Future;
use std::sync::{Arc, Condvar, LazyLock, Mutex, PoisonError};

use quick_cache::sync::{Cache as QuickCache, DefaultLifecycle, GuardResult};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

/// Bytes shared by callers without a budget of their own: twice the factor of the largest design.
const SHARED_BYTES: usize = 2 << 30;
/// Number of entries that a cache is laid out for, as an order of magnitude.
const THINGS: usize = 1000;
/// Share of the bytes for entries requested again; the rest is for new entries. No heavier entry is kept.
const PROVEN_SHARE: f64 = 0.5;

/// The kind of an entry, and all that it depends on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Key {
    /// Simulated paths of Brownian bridges.
    Bridges {
        /// Sample size of the laws they are for; all large sizes share one.
        sample_size: usize,
        /// Number of paths.
        paths: usize,
        /// Seed of the specification.
        seed: u64,
    },
    /// The factor behind a predicted deviation, by the hash of its inputs.
    Factor([u8; 32]),
    /// The levels of caution of a record, by the hash of their inputs.
    Levels([u8; 32]),
    /// A prepared policy, by its owner's name for it.
    Policy(Arc<str>),
}

impl Key {
    /// Returns the part of memory that the key counts towards.
    fn part(&self) -> CachePart {
        match self {
            Key::Bridges { .. } => CachePart::Bridges,
            Key::Factor(_) => CachePart::Factors,
            Key::Levels(_) => CachePart::Levels,
            Key::Policy(_) => CachePart::Policies,
        }
    }
}

/// The parts of the cache.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CachePart {
    /// Simulated paths.
    Bridges,
    /// Factors behind predicted deviations.
    Factors,
    /// Levels of caution.
    Levels,
    /// Prepared policies.
    Policies,
}

impl CachePart {
    /// Every part.
    pub const ALL: [CachePart; 4] = [CachePart::Bridges, CachePart::Factors, CachePart::Levels, CachePart::Policies];
}

/// An entry and its bytes.
#[derive(Clone)]
struct Thing {
    value: Arc<dyn Any + Send + Sync>,
    bytes: usize,
}

#[derive(Clone)]
struct Bytes;

impl Weighter<Key, Thing> for Bytes {
    fn weight(&self, _: &Key, thing: &Thing) -> u64 {
        // An entry of weight zero would never be dropped.
        thing.bytes.max(1) as u64
    }
}

/// A bounded cache; clones share it. The default is one for the process.
#[derive(Clone)]
pub struct Cache(Arc<CacheState>);

struct CacheState {
    things: QuickCache<Key, Thing, Bytes>,
    heaviest: usize,
    /// Bytes being computed; `made` wakes callers that wait for them to fall.
    making: Mutex<usize>,
    made: Condvar,
}

impl Default for Cache {
    fn default() -> Self {
        static SHARED: LazyLock<Cache> = LazyLock::new(|| Cache::new(SHARED_BYTES));
        SHARED.clone()
    }
}

impl Cache {
    /// Creates a cache of at most `bytes`; computations use at most half of that at a time in addition.
    pub fn new(bytes: usize) -> Self {
        let options = OptionsBuilder::new()
            .estimated_items_capacity(THINGS)
            .weight_capacity(bytes as u64)
            .hot_allocation(PROVEN_SHARE)
            // With several shards, each part of the bound would be too small for the heaviest entries.
            .shards(1)
            .build();
        let things = match options {
            Ok(options) => {
                QuickCache::with_options(options, Bytes, DefaultHashBuilder::default(), DefaultLifecycle::default())
            }
            // Cannot happen: every required option is set above.
            Err(_) => QuickCache::with_weighter(THINGS, bytes as u64, Bytes),
        };
        let heaviest = (bytes as f64 * PROVEN_SHARE) as usize;
        Cache(Arc::new(CacheState { things, heaviest, making: Mutex::new(0), made: Condvar::new() }))
    }

    /// Returns the largest bytes of an entry that is kept. Anything heavier is computed on every request.
    pub fn heaviest(&self) -> usize {
        self.0.heaviest
    }

    /// Returns true if the entry is available at once.
    pub fn has(&self, key: &Key) -> bool {
        self.0.things.contains_key(key)
    }

    /// Returns the entry of this key, if it is cached.
    pub fn get<T: Any + Send + Sync>(&self, key: &Key) -> Option<Arc<T>> {
        self.0.things.get(key)?.value.downcast().ok()
    }

    /// Returns the entry of this key, computed if it is not cached. `bytes` is its weight, and the memory that
    /// computing it takes. `make` may not ask for anything from the cache.
    pub fn get_or_make<T: Any + Send + Sync>(&self, key: &Key, bytes: usize, make: impl FnOnce() -> T) -> Arc<T> {
        match self.0.things.get_value_or_guard(key, None) {
            GuardResult::Value(thing) => {
                if let Ok(value) = thing.value.downcast::<T>() {
                    return value;
                }
            }
            GuardResult::Guard(place) => {
                let _room = self.room(bytes);
                let value = Arc::new(make());
                // Refused only if the key was forgotten meanwhile.
                let _ = place.insert(Thing { value: value.clone(), bytes });
                return value;
            }
            // Cannot happen: no wait has a time limit.
            GuardResult::Timeout => {}
        }
        Arc::new(make())
    }

    /// Returns the entry of this key, prepared if it is not cached; other callers of the key wait meanwhile.
    ///
    /// # Errors
    /// The error of `prepare`.
    pub async fn get_or_prepare<T: Any + Send + Sync, E>(
        &self,
        key: &Key,
        bytes: impl FnOnce(&T) -> usize,
        prepare: impl Future<Output = Result<T, E>>,
    ) -> Result<Arc<T>, E> {
        match self.0.things.get_value_or_guard_async(key).await {
            Ok(thing) => {
                if let Ok(value) = thing.value.downcast::<T>() {
                    return Ok(value);
                }
            }
            Err(place) => {
                let value = Arc::new(prepare.await?);
                let _ = place.insert(Thing { bytes: bytes(&value), value: value.clone() });
                return Ok(value);
            }
        }
        Ok(Arc::new(prepare.await?))
    }

    /// Drops the entry of the key, if there is one.
    pub fn forget(&self, key: &Key) {
        self.0.things.remove(key);
    }

    /// Returns the bytes of each part.
    pub fn bytes(&self) -> BTreeMap<CachePart, usize> {
        let mut parts: BTreeMap<CachePart, usize> = CachePart::ALL.map(|part| (part, 0)).into();
        for (key, thing) in self.0.things.iter() {
            *parts.entry(key.part()).or_default() += thing.bytes;
        }
        parts
    }

    /// Waits until computations in progress leave `bytes` free, or there are none.
    fn room(&self, bytes: usize) -> Reservation<'_> {
        let shelf = &*self.0;
        let making = shelf.making.lock().unwrap_or_else(PoisonError::into_inner);
        let crowded = |making: &mut usize| *making > 0 && making.saturating_add(bytes) > shelf.heaviest;
        let mut making = shelf.made.wait_while(making, crowded).unwrap_or_else(PoisonError::into_inner);
        *making = making.saturating_add(bytes);
        Reservation { shelf, bytes }
    }
}

/// Bytes of a computation in progress; released when dropped, also in a panic.
struct Reservation<'a> {
    shelf: &'a CacheState,
    bytes: usize,
}

impl Drop for Reservation<'_> {
    fn drop(&mut self) {
        let mut making = self.shelf.making.lock().unwrap_or_else(PoisonError::into_inner);
        *making = making.saturating_sub(self.bytes);
        self.shelf.made.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::thread;

    use super::*;

    fn key(sample_size: usize) -> Key {
        Key::Bridges { sample_size, paths: 1, seed: 1 }
    }

    fn kept_bytes(kept: &Cache) -> usize {
        kept.bytes().values().sum()
    }

    #[test]
    fn what_is_kept_stays_within_its_bytes_and_the_newest_is_among_it() {
        let kept = Cache::new(1000);
        for size in 0..100 {
            assert_eq!(*kept.get_or_make(&key(size), 90, || size), size);
            assert!(kept_bytes(&kept) <= 1000);
            assert!(kept.has(&key(size)));
        }
        assert!(kept_bytes(&kept) > 800);
    }

    #[test]
    fn what_is_too_heavy_is_made_each_time_and_drives_nothing_out() {
        let kept = Cache::new(1000);
        kept.get_or_make(&key(0), 400, || 0);
        let made = AtomicUsize::new(0);
        for _ in 0..2 {
            kept.get_or_make(&key(1), 501, || made.fetch_add(1, Ordering::Relaxed));
        }
        assert_eq!((made.into_inner(), kept.has(&key(0)), kept.has(&key(1))), (2, true, false));
    }

    #[test]
    fn many_who_ask_at_once_make_it_once_and_what_is_being_made_is_bounded() {
        let kept = Cache::new(1000);
        let (made, under_way, most) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
        let make = |size: usize| {
            let now = under_way.fetch_add(200, Ordering::SeqCst) + 200;
            most.fetch_max(now, Ordering::SeqCst);
            thread::yield_now();
            made.fetch_add(1, Ordering::SeqCst);
            under_way.fetch_sub(200, Ordering::SeqCst);
            size
        };
        thread::scope(|scope| {
            for size in 0..16 {
                let (kept, make) = (&kept, &make);
                scope.spawn(move || assert_eq!(*kept.get_or_make(&key(size % 4), 200, || make(size % 4)), size % 4));
            }
        });
        assert_eq!(made.into_inner(), 4);
        assert!(most.into_inner() <= 400, "two fit into half of a thousand");
    }
}
