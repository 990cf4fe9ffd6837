//! A version number for each session, which every write to the session changes.
//!
//! Only this process writes to the folder. If a session's number still equals the one noted before its rows were read,
//! the rows are unchanged and need no further read. A [`WriteInProgress`] accompanies a write and raises the number when the
//! write ends: after the commit and before the answer. It does so whatever the outcome, and even if no caller waits any
//! more. Between commit and answer the number is the old one, and either state of the session may be shown.
//!
//! Sessions share a fixed count of numbers, so memory does not grow with the sessions, and no number is ever dropped.
//! If a shared number was raised, a session that was not written to has its head read once more than necessary.

use std::hash::{BuildHasher, RandomState};

use super::sync::{Arc, AtomicU64, Ordering};

/// 4 MB. One in six of 100,000 sessions shares its number with another.
pub(super) const NUMBERS: usize = 1 << 19;

pub(super) struct Changes {
    numbers: Box<[AtomicU64]>,
    /// Keyed at random, so that no client can choose whose number to share.
    hasher: RandomState,
}

impl Changes {
    pub(super) fn new(numbers: usize) -> Arc<Self> {
        let numbers = (0..numbers).map(|_| AtomicU64::new(0)).collect();
        Arc::new(Changes { numbers, hasher: RandomState::new() })
    }

    /// Returns the current number of `session`. Call this before its rows are read.
    pub(super) fn number(&self, session: &str) -> u64 {
        self.numbers[self.place(session)].load(Ordering::Acquire)
    }

    /// Returns the change of a write to `session` that is not committed yet.
    pub(super) fn of(self: &Arc<Self>, session: &str) -> WriteInProgress {
        WriteInProgress { place: self.place(session), changes: self.clone() }
    }

    fn place(&self, session: &str) -> usize {
        // Below the count of numbers, so it fits a `usize`.
        (self.hasher.hash_one(session) % self.numbers.len() as u64) as usize
    }
}

/// A write in progress; dropped once it has ended, before it is answered.
pub(super) struct WriteInProgress {
    changes: Arc<Changes>,
    place: usize,
}

impl Drop for WriteInProgress {
    fn drop(&mut self) {
        self.changes.numbers[self.place].fetch_add(1, Ordering::Release);
    }
}
