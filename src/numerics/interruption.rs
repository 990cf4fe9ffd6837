//! Work that others may stop, or make wait.
//!
//! Whoever starts a piece of work gives it a [`Watcher`]; the loops of the solvers pass [`checkpoint`]. A piece that is stopped
//! unwinds with [`Stopped`], which [`watched`] catches: no solver returns half a result, and none has to hand a flag through. Salsa
//! cancels its queries in this way. No checkpoint may lie where a lock is held, or where something shared is being made: a piece
//! that waits there would keep others waiting for it. Checked by: the tests below and `tests/operation/interruption.rs`.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

/// Decides whether a piece of work goes on.
pub trait Watcher: Send + Sync {
    /// Whether nobody wants the result any more.
    fn is_stopped(&self) -> bool;

    /// Returns once the piece may go on; called on the thread that the work was started on alone.
    fn give_way(&self) {}
}

/// The work was stopped before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

thread_local! {
    static WATCHER: RefCell<Option<Watched>> = const { RefCell::new(None) };
}

/// The watcher of the work on a thread.
#[derive(Clone)]
struct Watched {
    watcher: Arc<dyn Watcher>,
    /// Whether the work was started on this thread.
    gives_way: bool,
}

/// Restores the watcher before, a panic included.
struct Restored(Option<Watched>);

impl Drop for Restored {
    fn drop(&mut self) {
        WATCHER.set(self.0.take());
    }
}

fn under<T>(watched: Option<Watched>, work: impl FnOnce() -> T) -> T {
    let _restored = Restored(WATCHER.replace(watched));
    work()
}

/// Does the work under a watcher.
///
/// # Errors
/// [`Stopped`] at a checkpoint.
///
/// # Panics
/// With what `work` panics with.
pub fn watched<T>(watcher: Arc<dyn Watcher>, work: impl FnOnce() -> T) -> Result<T, Stopped> {
    let watched = Watched { watcher, gives_way: true };
    catch_unwind(AssertUnwindSafe(|| under(Some(watched), work)))
        .map_err(|panic| if panic.is::<Stopped>() { Stopped } else { resume_unwind(panic) })
}

/// Ends the work under way on this thread if it is stopped, or waits while others come first. Cost: some 30 ns; nothing without a
/// watcher.
pub fn checkpoint() {
    let is_stopped = WATCHER.with_borrow(|watched| {
        let Some(Watched { watcher, gives_way }) = watched else { return false };
        if *gives_way && !watcher.is_stopped() {
            watcher.give_way();
        }
        watcher.is_stopped()
    });
    if is_stopped {
        resume_unwind(Box::new(Stopped));
    }
}

/// The watcher of this thread, for parts of the work that other threads do.
#[derive(Clone)]
pub struct Carried(Option<Watched>);

/// Takes the watcher of this thread along.
pub fn carried() -> Carried {
    let watched = WATCHER.with_borrow(Clone::clone);
    Carried(watched.map(|watched| Watched { gives_way: false, ..watched }))
}

impl Carried {
    /// Whether there is a watcher.
    pub fn is_watched(&self) -> bool {
        self.0.is_some()
    }

    /// Does a part of the work, which can be stopped and does not wait.
    pub fn within<T>(&self, part: impl FnOnce() -> T) -> T {
        match &self.0 {
            Some(watched) => under(Some(watched.clone()), part),
            None => part(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// Stops after so many checkpoints at which it was asked to give way.
    struct After(usize, AtomicUsize);

    impl Watcher for After {
        fn is_stopped(&self) -> bool {
            self.1.load(Ordering::Relaxed) >= self.0
        }

        fn give_way(&self) {
            self.1.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn after(count: usize) -> Arc<After> {
        Arc::new(After(count, AtomicUsize::new(0)))
    }

    #[test]
    fn work_ends_at_the_checkpoint_and_drops_what_it_holds() {
        let held = Arc::new(());
        let in_work = held.clone();
        let passed = AtomicUsize::new(0);
        let work = || {
            let _held = in_work;
            loop {
                checkpoint();
                passed.fetch_add(1, Ordering::Relaxed);
            }
        };
        assert_eq!(watched(after(3), work), Err::<(), _>(Stopped));
        assert_eq!((passed.into_inner(), Arc::strong_count(&held)), (2, 1));
    }

    #[test]
    fn nothing_is_watched_outside_and_after() {
        checkpoint();
        assert_eq!(watched(after(9), || 7), Ok(7));
        assert!(!carried().is_watched());
        let panicked = catch_unwind(AssertUnwindSafe(|| watched(after(9), || panic!("of its own"))));
        assert_eq!(panicked.unwrap_err().downcast_ref(), Some(&"of its own"));
        assert!(!carried().is_watched());
        checkpoint();
    }

    #[test]
    fn a_part_on_another_thread_is_stopped_and_asks_for_no_turn() {
        let watcher = after(1);
        let stopped = watched(watcher.clone(), || {
            let carried = carried();
            std::thread::scope(|scope| scope.spawn(|| carried.within(checkpoint)).join()).unwrap();
            assert_eq!(watcher.1.load(Ordering::Relaxed), 0);
            watcher.1.store(1, Ordering::Relaxed);
            let part = std::thread::scope(|scope| scope.spawn(|| carried.within(checkpoint)).join());
            part.unwrap_or_else(|panic| resume_unwind(panic));
        });
        assert_eq!(stopped, Err(Stopped));
    }
}
