//! The slots of live sessions under many orders of their users, chosen by a checker of concurrency.
//!
//! `src/service/sessions/slots.rs` and `src/store/engine/sqlite/changes.rs` are compiled here as they are, over the checker's locks and
//! atomics. The store is a model: every step of a read or a write is one at which others may run, and reads fail by
//! chance. An owner observes and asks for actions; others poll, delete what is not theirs, stop waiting, and push
//! sessions out of memory.
//!
//! Two things keep a law from being used after it went out of date: a slot that is held stays the only one, and a state
//! is held against the store before every use. Each alone is shown to be enough. With neither, as where a refused call
//! takes the slot from under those who wait for it, the checker finds the fault: so it could see it.

#[allow(dead_code)]
#[path = "../src/store/engine/sqlite/changes.rs"]
mod changes;
#[allow(dead_code)]
#[path = "../src/service/sessions/slots.rs"]
mod slots;

/// The primitives that they are compiled over.
mod sync {
    pub use shuttle::sync::atomic::{AtomicU64, Ordering};
    pub use shuttle::sync::{Arc, Mutex, MutexGuard, PoisonError};
    pub use tokio::sync::OwnedMutexGuard;

    /// Tokio's own lock, behind a point at which others may run.
    pub struct AsyncMutex<T>(Arc<tokio::sync::Mutex<T>>);

    impl<T> AsyncMutex<T> {
        pub fn new(value: T) -> Self {
            AsyncMutex(Arc::new(tokio::sync::Mutex::new(value)))
        }

        pub async fn lock_owned(self: Arc<Self>) -> OwnedMutexGuard<T> {
            shuttle::future::yield_now().await;
            self.0.clone().lock_owned().await
        }

        pub fn try_lock(&self) -> Result<tokio::sync::MutexGuard<'_, T>, tokio::sync::TryLockError> {
            self.0.try_lock()
        }
    }
}

use std::collections::HashMap;
use std::future::{Future, poll_fn};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex as Plain;
use std::task::Poll;

use changes::Changes;
use shuttle::future::{block_on, spawn, yield_now};
use shuttle::rand::Rng;
use shuttle::scheduler::{PctScheduler, RandomScheduler, Scheduler};
use shuttle::{Config, FailurePersistence, Runner};
use slots::{Generation, SlotGuard, Slots, Source};
use sync::{Arc, AsyncMutex, Mutex, OwnedMutexGuard};

const PERIODS: usize = 3;
const SCHEDULES: usize = 3_000;
/// Orders in which at most so many turns are taken out of the usual one.
const DEPTH: usize = 4;
const SEED: u64 = 13;
/// One generation has room for one session: others push it out.
const ROOM: Generation = Generation { slots: 1, weight: usize::MAX };
const OWNED: &str = "owned";

/// The comparison of a state with the store before it is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Comparing {
    Heads,
    Nothing,
}

#[derive(Debug, PartialEq, Eq)]
enum Refused {
    Unavailable,
    NotYours,
}

/// The rows of one session.
struct Facts {
    observed: Plain<usize>,
    /// Periods answered to their owner.
    acknowledged: Plain<usize>,
    changes: Arc<Changes>,
    comparing: Comparing,
}

/// The states in memory.
struct Law {
    observed: usize,
    change: u64,
}

impl Facts {
    /// A step in which the store is busy, and others run; it may fail.
    async fn pause(&self) -> Result<(), Refused> {
        yield_now().await;
        if shuttle::rand::thread_rng().gen_range(0..4) == 0 { Err(Refused::Unavailable) } else { Ok(()) }
    }

    async fn append(&self, period: usize) -> Result<(), Refused> {
        let change = self.changes.of(OWNED);
        let paused = self.pause().await;
        let mut outcome = Err(Refused::Unavailable);
        // Failed before its commit, or after.
        if paused.is_ok() {
            let mut observed = self.observed.lock().unwrap();
            assert!(*observed + 1 >= period, "stale law: period {period} was expected after {observed}");
            *observed = period.max(*observed);
            outcome = Ok(());
        }
        yield_now().await;
        drop(change);
        yield_now().await;
        self.pause().await.and(outcome)
    }
}

/// The session as its owner reads it.
struct Own<'a>(&'a Facts);

impl Source<Law> for Own<'_> {
    type Error = Refused;

    async fn is_current(&self, law: &mut Law) -> Result<bool, Refused> {
        let change = self.0.changes.number(OWNED);
        if self.0.comparing == Comparing::Nothing || change == law.change {
            return Ok(true);
        }
        self.0.pause().await?;
        let is_current = *self.0.observed.lock().unwrap() == law.observed;
        if is_current {
            law.change = change;
        }
        Ok(is_current)
    }

    async fn read(&self) -> Result<Law, Refused> {
        let change = self.0.changes.number(OWNED);
        self.0.pause().await?;
        let observed = *self.0.observed.lock().unwrap();
        self.0.pause().await?;
        Ok(Law { observed, change })
    }
}

/// The session as somebody else reads it.
struct Foreign<'a>(&'a Facts);

impl Source<Law> for Foreign<'_> {
    type Error = Refused;

    async fn is_current(&self, law: &mut Law) -> Result<bool, Refused> {
        Own(self.0).is_current(law).await
    }

    async fn read(&self) -> Result<Law, Refused> {
        self.0.pause().await?;
        Err(Refused::NotYours)
    }
}

/// A map from names to slots.
trait Places: Send + Sync + Sized + 'static {
    type Holder: Holder;

    fn new() -> Arc<Self>;
    fn hold(places: &Arc<Self>, name: &'static str) -> impl Future<Output = Self::Holder> + Send;
}

/// Who has the lock of a slot.
trait Holder: Send {
    fn current<R: Source<Law, Error = Refused> + Sync>(
        &mut self,
        source: &R,
    ) -> impl Future<Output = Result<&mut Law, Refused>> + Send;
    fn clear(&mut self);
    fn put(&mut self, law: Law);
    /// After a refused deletion.
    fn forget(&self);
}

type Owned = Slots<&'static str, Law>;

impl Places for Owned {
    type Holder = SlotGuard<&'static str, Law>;

    fn new() -> Arc<Self> {
        Arc::new(Slots::new(ROOM))
    }

    async fn hold(places: &Arc<Self>, name: &'static str) -> Self::Holder {
        places.hold(name).await
    }
}

impl Holder for SlotGuard<&'static str, Law> {
    async fn current<R: Source<Law, Error = Refused> + Sync>(&mut self, source: &R) -> Result<&mut Law, Refused> {
        SlotGuard::current(self, source).await
    }

    fn clear(&mut self) {
        SlotGuard::clear(self);
    }

    fn put(&mut self, law: Law) {
        SlotGuard::put(self, law);
    }

    fn forget(&self) {}
}

/// The fault: a failed read and a refused deletion take the slot out of the map while others wait for its lock.
#[derive(Default)]
struct Forgetful(Mutex<HashMap<&'static str, Arc<AsyncMutex<Option<Law>>>>>);

struct Forgotten {
    law: OwnedMutexGuard<Option<Law>>,
    places: Arc<Forgetful>,
    name: &'static str,
}

impl Places for Forgetful {
    type Holder = Forgotten;

    fn new() -> Arc<Self> {
        Arc::default()
    }

    async fn hold(places: &Arc<Self>, name: &'static str) -> Forgotten {
        let new = || Arc::new(AsyncMutex::new(None));
        let slot = places.0.lock().unwrap().entry(name).or_insert_with(new).clone();
        Forgotten { law: slot.lock_owned().await, places: places.clone(), name }
    }
}

impl Holder for Forgotten {
    async fn current<R: Source<Law, Error = Refused> + Sync>(&mut self, source: &R) -> Result<&mut Law, Refused> {
        if let Some(law) = self.law.as_mut()
            && !source.is_current(law).await?
        {
            *self.law = None;
        }
        let law = match self.law.take() {
            Some(law) => law,
            None => source.read().await.inspect_err(|_| self.forget())?,
        };
        Ok(self.law.insert(law))
    }

    fn clear(&mut self) {
        *self.law = None;
    }

    fn put(&mut self, law: Law) {
        *self.law = Some(law);
    }

    fn forget(&self) {
        self.places.0.lock().unwrap().remove(self.name);
    }
}

async fn observe<P: Places>(places: &Arc<P>, facts: &Facts, period: usize) -> Result<(), Refused> {
    let mut held = P::hold(places, OWNED).await;
    let law = held.current(&Own(facts)).await?;
    if law.observed >= period {
        return Ok(());
    }
    assert_eq!(law.observed + 1, period, "stale law: period {period} is refused");
    let next = Law { observed: period, change: law.change + 1 };
    held.clear();
    facts.append(period).await?;
    held.put(next);
    Ok(())
}

/// The period of an action that was asked for after so many periods were acknowledged.
async fn act<P: Places>(places: &Arc<P>, facts: &Facts) -> Result<(), Refused> {
    let acknowledged = *facts.acknowledged.lock().unwrap();
    let mut held = P::hold(places, OWNED).await;
    let law = held.current(&Own(facts)).await?;
    assert!(law.observed >= acknowledged, "stale law: {} of {acknowledged} periods are in it", law.observed);
    Ok(())
}

async fn own<P: Places>(places: Arc<P>, facts: Arc<Facts>) {
    for period in 1..=PERIODS {
        while observe(&places, &facts, period).await.is_err() {}
        *facts.acknowledged.lock().unwrap() = period;
        while act(&places, &facts).await.is_err() {}
    }
}

async fn poll<P: Places>(places: Arc<P>, facts: Arc<Facts>) {
    for _ in 0..2 * PERIODS {
        // Answered or not: what counts is that no answer is stale.
        let _ = act(&places, &facts).await;
    }
}

/// A refused look, and a refused deletion, of a session by its name.
async fn intrude<P: Places>(places: Arc<P>, facts: Arc<Facts>) {
    for _ in 0..PERIODS {
        let mut held = P::hold(&places, OWNED).await;
        let _ = held.current(&Foreign(&facts)).await;
        drop(held);
        let mut held = P::hold(&places, OWNED).await;
        held.clear();
        let _ = facts.pause().await;
        held.forget();
    }
}

/// Comes for the session, and stops waiting; asks for other sessions, of which there are none.
async fn pass_by<P: Places>(places: Arc<P>, facts: Arc<Facts>) {
    for other in ["another", "a third"] {
        let mut waiting = Box::pin(P::hold(&places, OWNED));
        poll_fn(|context| {
            let _ = waiting.as_mut().poll(context);
            Poll::Ready(())
        })
        .await;
        yield_now().await;
        drop(waiting);
        let _ = P::hold(&places, other).await.current(&Foreign(&facts)).await;
    }
}

/// All of them at once; what is left.
fn story<P: Places>(comparing: Comparing) -> Arc<P> {
    // One number for all sessions: every write elsewhere looks like one to this session.
    let changes = Changes::new(1);
    let facts = Arc::new(Facts { observed: Plain::new(0), acknowledged: Plain::new(0), changes, comparing });
    let places = P::new();
    let tasks = [
        spawn(own(places.clone(), facts.clone())),
        spawn(poll(places.clone(), facts.clone())),
        spawn(intrude(places.clone(), facts.clone())),
        spawn(pass_by(places.clone(), facts.clone())),
    ];
    for task in tasks {
        block_on(task).expect("a task");
    }
    assert_eq!(*facts.observed.lock().unwrap(), PERIODS);
    places
}

fn explore(scheduler: impl Scheduler + 'static, story: impl Fn() + Send + Sync + 'static) {
    let mut config = Config::new();
    config.failure_persistence = FailurePersistence::None;
    Runner::new(scheduler, config).run(story);
}

fn explore_all(story: impl Fn() + Send + Sync + Clone + 'static) {
    explore(RandomScheduler::new_from_seed(SEED, SCHEDULES), story.clone());
    explore(PctScheduler::new_from_seed(SEED, DEPTH, SCHEDULES), story);
}

#[test]
fn no_order_of_users_leaves_a_stale_law() {
    explore_all(|| {
        let places = story::<Owned>(Comparing::Heads);
        assert!(places.count() <= 1, "an empty slot is kept");
    });
}

#[test]
fn one_slot_a_session_is_enough() {
    explore_all(|| drop(story::<Owned>(Comparing::Nothing)));
}

#[test]
fn comparing_with_the_store_is_enough() {
    explore_all(|| drop(story::<Forgetful>(Comparing::Heads)));
}

#[test]
fn a_map_that_forgets_slots_in_use_is_caught() {
    let forgetful = || explore_all(|| drop(story::<Forgetful>(Comparing::Nothing)));
    let caught = catch_unwind(AssertUnwindSafe(forgetful)).expect_err("the checker saw no fault");
    let message = caught.downcast_ref::<String>().map_or("", String::as_str);
    assert!(message.contains("stale law"), "{message}");
}

#[test]
fn who_is_held_or_asked_for_stays_and_who_is_left_alone_goes() {
    const ROOMS: Generation = Generation { slots: 2, weight: 100 };
    explore(RandomScheduler::new_from_seed(SEED, 1), || {
        block_on(async {
            let slots: Arc<Slots<String, usize>> = Arc::new(Slots::new(ROOMS));
            let keep = async |name: &str| slots.hold(name.to_owned()).await.put(7);
            let kept = async |name: &str| slots.hold(name.to_owned()).await.current(&Nothing).await.is_ok();
            let held = slots.hold("held".to_owned()).await;
            keep("left alone").await;
            for round in 0..6 {
                keep("asked for").await;
                keep(&format!("new {round}")).await;
            }
            assert!(kept("asked for").await && !kept("left alone").await);
            let mut waiting = Box::pin(slots.hold("held".to_owned()));
            for _ in 0..8 {
                let is_free = poll_fn(|context| Poll::Ready(waiting.as_mut().poll(context).is_ready())).await;
                assert!(!is_free, "there is a second slot");
                yield_now().await;
            }
            drop((waiting, held));
            assert!(slots.count() <= 2 * ROOMS.slots);
            for name in ["heavy", "heavier", "heaviest"] {
                keep(name).await;
                slots.weigh(&name.to_owned(), 100);
            }
            assert_eq!(slots.count(), 2, "what fills a generation by its weight ages it");
            keep("heavier").await;
            assert_eq!(slots.bytes(), 200, "what is asked for again weighs again");
        });
    });
}

/// Has nothing, and finds what is in memory current.
struct Nothing;

impl Source<usize> for Nothing {
    type Error = ();

    async fn is_current(&self, _: &mut usize) -> Result<bool, ()> {
        Ok(true)
    }

    async fn read(&self) -> Result<usize, ()> {
        Err(())
    }
}
