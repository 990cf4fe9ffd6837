//! Which sessions were written to: a number each, that every write changes.
//!
//! The folder is written by this process alone, so a session whose number is the one that was seen before its rows were
//! read still has those rows, and nobody needs to read them to know. A [`Change`] goes with a write and raises the number
//! when it ends: after the commit, before the answer, whatever the outcome and even where nobody waits for it any more.
//! Between commit and answer the number is the old one, when either state of the session may be shown.
//!
//! Sessions share the numbers, of which there is a fixed count: nothing grows with the sessions, and nothing is ever
//! forgotten. Who shares a number that was raised reads the head of its session once more than it had to.

use std::hash::{BuildHasher, RandomState};

use super::sync::{Arc, AtomicU64, Ordering};

/// 4 MB. One in six of 100,000 sessions shares its number with another.
pub(super) const NUMBERS: usize = 1 << 19;

pub(super) struct Changes {
    numbers: Box<[AtomicU64]>,
    /// Keyed by chance: nobody can choose whose number to share.
    hasher: RandomState,
}

impl Changes {
    pub(super) fn new(numbers: usize) -> Arc<Self> {
        let numbers = (0..numbers).map(|_| AtomicU64::new(0)).collect();
        Arc::new(Changes { numbers, hasher: RandomState::new() })
    }

    /// The number of `session` now. To be asked before its rows are read.
    pub(super) fn number(&self, session: &str) -> u64 {
        self.numbers[self.place(session)].load(Ordering::Acquire)
    }

    /// A write to `session` that has yet to be committed.
    pub(super) fn of(self: &Arc<Self>, session: &str) -> Change {
        Change { place: self.place(session), changes: self.clone() }
    }

    fn place(&self, session: &str) -> usize {
        // Below the count of numbers, so of an address's width.
        (self.hasher.hash_one(session) % self.numbers.len() as u64) as usize
    }
}

/// A write under way; dropped once it ended, before it is answered.
pub(super) struct Change {
    changes: Arc<Changes>,
    place: usize,
}

impl Drop for Change {
    fn drop(&mut self) {
        self.changes.numbers[self.place].fetch_add(1, Ordering::Release);
    }
}
