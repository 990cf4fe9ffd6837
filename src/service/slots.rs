//! Which live sessions stay in memory.
//!
//! Two generations: a session that is asked for joins the young one; when that is full it becomes the old one, and what
//! was old and has not been asked for since is dropped, to be replayed from its rows should it be. Nothing is held for
//! sessions that nobody asks for.

use std::collections::HashMap;
use std::mem;
use std::sync::Arc;

use tokio::sync::Mutex as AsyncMutex;

use super::live::Live;

/// Sessions of one generation.
const SESSIONS: usize = 100_000;
/// Returns in the laws and histories of one generation: 128 MB.
const RETURNS: usize = 1 << 24;

/// A session's place: its lock orders what is done to the session in this process.
pub(super) type Slot = Arc<AsyncMutex<Option<Live>>>;

#[derive(Default)]
pub(super) struct Slots {
    young: HashMap<String, Slot>,
    old: HashMap<String, Slot>,
    /// Returns read into memory since the young generation began.
    returns: usize,
}

impl Slots {
    /// The one slot of `session`.
    pub(super) fn of(&mut self, session: &str) -> Slot {
        if let Some(slot) = self.young.get(session) {
            return slot.clone();
        }
        let slot = self.old.remove(session).unwrap_or_default();
        if self.young.len() >= SESSIONS || self.returns >= RETURNS {
            self.age();
        }
        self.young.insert(session.to_owned(), slot.clone());
        slot
    }

    fn age(&mut self) {
        let dropped = mem::replace(&mut self.old, mem::take(&mut self.young));
        // A slot in use must stay the only one of its session.
        self.young.extend(dropped.into_iter().filter(|(_, slot)| Arc::strong_count(slot) > 1));
        self.returns = 0;
    }

    /// So many returns more are in memory.
    pub(super) fn grow(&mut self, returns: usize) {
        self.returns += returns;
    }

    pub(super) fn forget(&mut self, session: &str) {
        self.young.remove(session);
        self.old.remove(session);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_asked_for_stays_and_who_is_in_use_keeps_the_one_slot() {
        let mut slots = Slots::default();
        let used = slots.of("used");
        let kept = Arc::downgrade(&slots.of("asked for"));
        let dropped = Arc::downgrade(&slots.of("left alone"));
        for round in 0..3 {
            slots.grow(RETURNS);
            slots.of(&format!("new {round}"));
            assert!(kept.ptr_eq(&Arc::downgrade(&slots.of("asked for"))));
        }
        assert_eq!(dropped.strong_count(), 0);
        assert!(Arc::ptr_eq(&used, &slots.of("used")));
        slots.forget("used");
        assert!(!Arc::ptr_eq(&used, &slots.of("used")));
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut slots = Slots::default();
        for index in 0..3 * SESSIONS {
            slots.of(&index.to_string());
        }
        assert!(slots.young.len() + slots.old.len() <= 2 * SESSIONS);
    }
}
