//! Work that can be stopped, or made to wait.
//!
//! A caller that starts work gives it a [`Watcher`], and the loops of the solvers call [`checkpoint`]. Work that is
//! stopped unwinds with [`Stopped`], which [`watched`] catches. So no solver returns half a result, and none has to
//! pass a flag down; Salsa cancels its queries in this way. No checkpoint may be reached while a lock is held or
//! something shared is being made, because work that waits there would make others wait for it. Checked by: the tests
//! below and `tests/operation/interruption.rs`.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

/// Decides if a piece of work continues.
pub trait Watcher: Send + Sync {
    /// Returns true if nobody needs the result any more.
    fn is_stopped(&self) -> bool;

    /// Returns once the work may continue; called only on the thread on which the work started.
    fn give_way(&self) {}
}

/// The error that work was stopped before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

thread_local! {
    static WATCHER: RefCell<Option<Watched>> = const { RefCell::new(None) };
}

/// The watcher of the work on a thread.
#[derive(Clone)]
struct Watched {
    watcher: Arc<dyn Watcher>,
    /// True if the work was started on this thread.
    gives_way: bool,
}

/// Restores the previous watcher when dropped, also after a panic.
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

/// Runs the work under a watcher.
///
/// # Errors
/// [`Stopped`] if the work was stopped at a checkpoint.
///
/// # Panics
/// Panics with the panic of `work`.
pub fn watched<T>(watcher: Arc<dyn Watcher>, work: impl FnOnce() -> T) -> Result<T, Stopped> {
    let watched = Watched { watcher, gives_way: true };
    catch_unwind(AssertUnwindSafe(|| under(Some(watched), work)))
        .map_err(|panic| if panic.is::<Stopped>() { Stopped } else { resume_unwind(panic) })
}

/// Ends the current work on this thread if it is stopped, or waits while other work goes first. Cost: about 30 ns, or
/// nothing without a watcher.
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

/// The watcher of this thread, for parts of the work that run on other threads.
#[derive(Clone)]
pub struct Carried(Option<Watched>);

/// Returns the watcher of this thread, to pass to other threads.
pub fn carried() -> Carried {
    let watched = WATCHER.with_borrow(Clone::clone);
    Carried(watched.map(|watched| Watched { gives_way: false, ..watched }))
}

impl Carried {
    /// Returns true if there is a watcher.
    pub fn is_watched(&self) -> bool {
        self.0.is_some()
    }

    /// Runs a part of the work, which can be stopped but does not wait.
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

    /// Stops after this many calls of `give_way`.
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
