//! A cache of states, with one lock for each name.
//!
//! A state is a copy of what the store holds, and each name has one slot for it. A slot is
//!
//! - absent, until a caller holds the name;
//! - held, by the caller with its lock and by all that wait for it; it has a state or is empty;
//! - kept, if it has a state and no caller holds it; an empty slot becomes absent at once.
//!
//! A stale state is never used, for these reasons in order:
//!
//! 1. No slot that is held leaves the map, so later callers wait for the same lock as those that wait already.
//! 2. [`SlotGuard::current`] is the only way to a state. Before every use it checks with the [`Source`] that the state is current.
//!    If the source does not answer, there is an error and no state.
//! 3. A state is out of its slot while the source decides on its successor. It is replaced or read again, never kept.
//!
//! Either of the first two would be enough. `tests/slots.rs` shows this with a concurrency checker, and also that the
//! checker finds the fault if neither holds.
//!
//! Memory is bounded by two generations. A slot that is held joins the young one. When that is full it becomes the old
//! one, and old slots that nobody has held since are dropped. Their states are read again when needed.

use std::collections::HashMap;
use std::future::Future;
use std::hash::Hash;
use std::mem;

use super::sync::{Arc, AsyncMutex, Mutex, MutexGuard, OwnedMutexGuard, PoisonError};

/// The source of states.
pub trait Source<S> {
    type Error;

    /// Returns whether `state` is what [`Source::read`] would return now.
    fn is_current(&self, state: &mut S) -> impl Future<Output = Result<bool, Self::Error>> + Send;

    fn read(&self) -> impl Future<Output = Result<S, Self::Error>> + Send;
}

/// The limits of one generation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Generation {
    pub slots: usize,
    /// Sum of the weights given to [`Slots::weigh`], in bytes.
    pub weight: usize,
}

/// The slots of states `S`, each with a name `N`.
pub(super) struct Slots<N: Eq + Hash + Clone, S> {
    largest: Generation,
    map: Mutex<Map<N, S>>,
}

/// The part of a slot that its users share.
type Shared<S> = Arc<AsyncMutex<Option<S>>>;

struct Slot<S> {
    state: Shared<S>,
    /// Callers that have its lock or wait for it. Changed only under the lock of the map.
    holders: usize,
    /// Bytes, once its state was read.
    weight: usize,
}

struct Map<N, S> {
    young: HashMap<N, Slot<S>>,
    old: HashMap<N, Slot<S>>,
    /// Bytes of the young generation.
    weight: usize,
}

impl<N: Eq + Hash + Clone, S> Slots<N, S> {
    pub fn new(largest: Generation) -> Self {
        Slots { largest, map: Mutex::new(Map { young: HashMap::new(), old: HashMap::new(), weight: 0 }) }
    }

    /// Waits until no earlier caller holds the slot of `name`.
    pub async fn hold(self: &Arc<Self>, name: N) -> SlotGuard<N, S> {
        let (state, dropped) = self.lock().enter(&name, self.largest);
        // After the lock of the map is released, because dropping a generation takes a while.
        drop(dropped);
        // Counted from here on, even if the caller stops waiting.
        let place = SlotHolder { slots: self.clone(), name };
        SlotGuard { state: state.lock_owned().await, _place: place }
    }

    /// Sets the bytes that the state of a held slot takes.
    pub fn weigh(&self, name: &N, weight: usize) {
        let mut map = self.lock();
        let Map { young, old, weight: of_the_young } = &mut *map;
        if let Some(slot) = young.get_mut(name) {
            *of_the_young = of_the_young.saturating_sub(slot.weight).saturating_add(weight);
            slot.weight = weight;
        } else if let Some(slot) = old.get_mut(name) {
            slot.weight = weight;
        }
    }

    /// Returns the bytes of all slots.
    pub fn bytes(&self) -> usize {
        let map = self.lock();
        map.weight + weight_of(&map.old)
    }

    /// Returns the number of slots, held or kept.
    pub fn count(&self) -> usize {
        let map = self.lock();
        map.young.len() + map.old.len()
    }

    fn lock(&self) -> MutexGuard<'_, Map<N, S>> {
        // No code panics while holding the lock.
        self.map.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<N: Eq + Hash + Clone, S> Map<N, S> {
    /// Returns the slot of `name`, with one more holder, and the slots dropped to make room.
    fn enter(&mut self, name: &N, largest: Generation) -> (Shared<S>, HashMap<N, Slot<S>>) {
        let mut dropped = HashMap::new();
        if !self.young.contains_key(name) {
            let slot = self.old.remove(name).unwrap_or_else(Slot::empty);
            if self.young.len() >= largest.slots || self.weight >= largest.weight {
                dropped = self.age();
            }
            self.weight += slot.weight;
            self.young.insert(name.clone(), slot);
        }
        let slot = self.young.entry(name.clone()).or_insert_with(Slot::empty);
        slot.holders += 1;
        (slot.state.clone(), dropped)
    }

    /// Makes the young generation the old one, and returns the old slots that nobody holds, to be dropped.
    fn age(&mut self) -> HashMap<N, Slot<S>> {
        let old = mem::replace(&mut self.old, mem::take(&mut self.young));
        let (held, dropped) = old.into_iter().partition(|(_, slot)| slot.holders > 0);
        self.weight = weight_of(&held);
        self.young = held;
        dropped
    }

    /// Removes one holder; an empty slot is removed with its last holder.
    fn leave(&mut self, name: &N) {
        let is_young = self.young.contains_key(name);
        let generation = if is_young { &mut self.young } else { &mut self.old };
        let Some(slot) = generation.get_mut(name) else { return };
        slot.holders -= 1;
        if slot.holders == 0 && slot.state.try_lock().is_ok_and(|state| state.is_none()) {
            let weight = generation.remove(name).map_or(0, |slot| slot.weight);
            if is_young {
                self.weight -= weight;
            }
        }
    }
}

fn weight_of<N, S>(slots: &HashMap<N, Slot<S>>) -> usize {
    slots.values().map(|slot| slot.weight).sum()
}

impl<S> Slot<S> {
    fn empty() -> Self {
        Slot { state: Arc::new(AsyncMutex::new(None)), holders: 0, weight: 0 }
    }
}

/// A slot whose lock is held until drop.
pub struct SlotGuard<N: Eq + Hash + Clone, S> {
    // Dropped first: when the last holder leaves, no caller has the lock.
    state: OwnedMutexGuard<Option<S>>,
    _place: SlotHolder<N, S>,
}

impl<N: Eq + Hash + Clone, S> SlotGuard<N, S> {
    /// Returns the present state of `source`: the one in memory if it is current, otherwise read again.
    ///
    /// # Errors
    /// The source does not answer, or has no such state.
    pub async fn current<R: Source<S>>(&mut self, source: &R) -> Result<&mut S, R::Error> {
        if let Some(state) = self.state.as_mut()
            && !source.is_current(state).await?
        {
            self.clear();
        }
        let state = match self.state.take() {
            Some(state) => state,
            None => source.read().await?,
        };
        Ok(self.state.insert(state))
    }

    /// Empties the slot, before a change of the source whose outcome may stay unknown.
    pub fn clear(&mut self) {
        *self.state = None;
    }

    /// Stores the new state of the source.
    pub fn put(&mut self, state: S) {
        *self.state = Some(state);
    }
}

/// One holder of a slot.
struct SlotHolder<N: Eq + Hash + Clone, S> {
    slots: Arc<Slots<N, S>>,
    name: N,
}

impl<N: Eq + Hash + Clone, S> Drop for SlotHolder<N, S> {
    fn drop(&mut self) {
        self.slots.lock().leave(&self.name);
    }
}
