//! What is kept ready, weighed in bytes: bridges, factors, levels of caution and prepared policies share one bound.
//!
//! Everything here can be made again to the same bits from its [`Key`], so dropping it costs time and nothing else.
//! Bridges depend on sample size, number of paths and seed alone, and a factor on its design and scales alone: policies
//! that ask for the same share it. Who asks for what another is making waits for that one. What is being made counts
//! as well, against a bound of its own, because making many large things at once takes as much as keeping them.

use std::any::Any;
use std::collections::BTreeMap;
use std::future::Future;
use std::sync::{Arc, Condvar, LazyLock, Mutex, PoisonError};

use quick_cache::sync::{Cache, DefaultLifecycle, GuardResult};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

/// What callers without a budget of their own share: twice the factor of the largest design.
const SHARED_BYTES: usize = 2 << 30;
/// Things that a cache is laid out for, as an order of magnitude.
const THINGS: usize = 1000;
/// Share of the bytes that what was asked for again may hold; the rest is for what is new. Nothing heavier is kept.
const PROVEN_SHARE: f64 = 0.5;

/// What a thing is, and all that it depends on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Key {
    /// Simulated paths of Brownian bridges.
    Bridges {
        /// Of the laws they are for; all large sizes share one.
        sample_size: usize,
        /// How many.
        paths: usize,
        /// Of the specification.
        seed: u64,
    },
    /// The factor behind a predicted deviation, by the hash of what it is made of.
    Factor([u8; 32]),
    /// The levels of caution of a record, by the hash of all that they are found from.
    Levels([u8; 32]),
    /// A prepared policy, by the name its owner knows it under.
    Policy(Arc<str>),
}

impl Key {
    /// The part of memory it counts to.
    fn part(&self) -> Part {
        match self {
            Key::Bridges { .. } => Part::Bridges,
            Key::Factor(_) => Part::Factors,
            Key::Levels(_) => Part::Levels,
            Key::Policy(_) => Part::Policies,
        }
    }
}

/// The parts of what is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Simulated paths.
    Bridges,
    /// Factors behind predicted deviations.
    Factors,
    /// Levels of caution.
    Levels,
    /// Prepared policies.
    Policies,
}

impl Part {
    /// Every part.
    pub const ALL: [Part; 4] = [Part::Bridges, Part::Factors, Part::Levels, Part::Policies];
}

/// A thing and what it weighs.
#[derive(Clone)]
struct Thing {
    value: Arc<dyn Any + Send + Sync>,
    bytes: usize,
}

#[derive(Clone)]
struct Bytes;

impl Weighter<Key, Thing> for Bytes {
    fn weight(&self, _: &Key, thing: &Thing) -> u64 {
        // Zero would never be dropped.
        thing.bytes.max(1) as u64
    }
}

/// A bounded cache; clones share it. The default is one for the process.
#[derive(Clone)]
pub struct Kept(Arc<Shelf>);

struct Shelf {
    things: Cache<Key, Thing, Bytes>,
    heaviest: usize,
    /// Bytes of what is being made, and who waits for them to become fewer.
    making: Mutex<usize>,
    made: Condvar,
}

impl Default for Kept {
    fn default() -> Self {
        static SHARED: LazyLock<Kept> = LazyLock::new(|| Kept::new(SHARED_BYTES));
        SHARED.clone()
    }
}

impl Kept {
    /// Keeps at most `bytes`, and makes at most half of that at a time beside it.
    pub fn new(bytes: usize) -> Self {
        let options = OptionsBuilder::new()
            .estimated_items_capacity(THINGS)
            .weight_capacity(bytes as u64)
            .hot_allocation(PROVEN_SHARE)
            // Parts of a bound that is shared out would each be too small for the heaviest things.
            .shards(1)
            .build();
        let things = match options {
            Ok(options) => {
                Cache::with_options(options, Bytes, DefaultHashBuilder::default(), DefaultLifecycle::default())
            }
            // Nothing above leaves out what is required.
            Err(_) => Cache::with_weighter(THINGS, bytes as u64, Bytes),
        };
        let heaviest = (bytes as f64 * PROVEN_SHARE) as usize;
        Kept(Arc::new(Shelf { things, heaviest, making: Mutex::new(0), made: Condvar::new() }))
    }

    /// What is heavier is made anew whenever it is asked for.
    pub fn heaviest(&self) -> usize {
        self.0.heaviest
    }

    /// Whether it could be had at once.
    pub fn has(&self, key: &Key) -> bool {
        self.0.things.contains_key(key)
    }

    /// The thing of this key, if it is here.
    pub fn get<T: Any + Send + Sync>(&self, key: &Key) -> Option<Arc<T>> {
        self.0.things.get(key)?.value.downcast().ok()
    }

    /// The thing of this key, made where it is not here. `bytes` is what it weighs, and what making it takes. What is
    /// made may not ask for anything kept.
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
                // Refused only where the key was forgotten meanwhile.
                let _ = place.insert(Thing { value: value.clone(), bytes });
                return value;
            }
            // Nothing waits for a limited time.
            GuardResult::Timeout => {}
        }
        Arc::new(make())
    }

    /// The thing of this key, prepared where it is not here; who else asks for it meanwhile waits.
    ///
    /// # Errors
    /// What preparing it fails with.
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

    /// Drops what is kept under the key, if anything is.
    pub fn forget(&self, key: &Key) {
        self.0.things.remove(key);
    }

    /// Bytes of each part.
    pub fn bytes(&self) -> BTreeMap<Part, usize> {
        let mut parts: BTreeMap<Part, usize> = Part::ALL.map(|part| (part, 0)).into();
        for (key, thing) in self.0.things.iter() {
            *parts.entry(key.part()).or_default() += thing.bytes;
        }
        parts
    }

    /// Waits until what is being made leaves room for so much more, or nothing is.
    fn room(&self, bytes: usize) -> Room<'_> {
        let shelf = &*self.0;
        let making = shelf.making.lock().unwrap_or_else(PoisonError::into_inner);
        let crowded = |making: &mut usize| *making > 0 && making.saturating_add(bytes) > shelf.heaviest;
        let mut making = shelf.made.wait_while(making, crowded).unwrap_or_else(PoisonError::into_inner);
        *making = making.saturating_add(bytes);
        Room { shelf, bytes }
    }
}

/// Bytes under way; given back when dropped, a panic included.
struct Room<'a> {
    shelf: &'a Shelf,
    bytes: usize,
}

impl Drop for Room<'_> {
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

    fn kept_bytes(kept: &Kept) -> usize {
        kept.bytes().values().sum()
    }

    #[test]
    fn what_is_kept_stays_within_its_bytes_and_the_newest_is_among_it() {
        let kept = Kept::new(1000);
        for size in 0..100 {
            assert_eq!(*kept.get_or_make(&key(size), 90, || size), size);
            assert!(kept_bytes(&kept) <= 1000);
            assert!(kept.has(&key(size)));
        }
        assert!(kept_bytes(&kept) > 800);
    }

    #[test]
    fn what_is_too_heavy_is_made_each_time_and_drives_nothing_out() {
        let kept = Kept::new(1000);
        kept.get_or_make(&key(0), 400, || 0);
        let made = AtomicUsize::new(0);
        for _ in 0..2 {
            kept.get_or_make(&key(1), 501, || made.fetch_add(1, Ordering::Relaxed));
        }
        assert_eq!((made.into_inner(), kept.has(&key(0)), kept.has(&key(1))), (2, true, false));
    }

    #[test]
    fn many_who_ask_at_once_make_it_once_and_what_is_being_made_is_bounded() {
        let kept = Kept::new(1000);
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
