//! Work that requests cause, bounded and taken in turn over tenants.
//!
//! A piece of work begins in one of the first places, of which a tenant has half at most, and has it for 100 ms. What takes
//! longer goes on in one of the places for long work, of which there are fewer than processors, and gives it up to the next
//! one each 250 ms. So whoever asks something short waits for moments of others, however long their questions are, and long
//! questions share what is left.
//! Whoever finds no place waits in the queue of the tenant, and a place that becomes free goes to the tenants in turn.
//!
//! A piece whose caller is gone, by a time limit, a closed connection or the end of the service, ends at its next checkpoint (see
//! [`interruption`]). Whoever has waited too long for a first place is told to come back.
//! Checked by: the tests below and `tests/operation/interruption.rs`.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{oneshot, watch};
use tracing::Instrument;

use super::allowance::Refused;
use super::error::ServiceError;
use super::spans;
use crate::numerics::interruption::{self, Stopped, Watcher};
use crate::store::Tenant;

/// How long a piece has its first place: most questions end within it.
const MOMENT: Duration = Duration::from_millis(100);
/// How long a piece has a place for long work while others wait for one.
const SHIFT: Duration = Duration::from_millis(250);
/// Long pieces that may wait for such a place, each on a thread of its own.
pub(super) const LONG_WAITING: usize = 16;
/// Those of one tenant.
const LONG_WAITING_OF_ONE: usize = 8;

/// Runs blocking work, so much of it at a time.
#[derive(Clone)]
pub struct Bounded {
    /// What the work is, in traces and metrics.
    pub name: &'static str,
    /// Pieces of one tenant that may begin at a time: half of all, so that others find places.
    pub of_one: usize,
    lines: Arc<[Mutex<Line>; 2]>,
    wait: Duration,
}

/// How many pieces of work may be under way.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// In their first moment.
    pub first: usize,
    /// After it.
    pub long: usize,
}

/// For whom places are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    First,
    Long,
}

/// Places of one kind, and who waits for them.
struct Line {
    /// Places that nobody has; while there are any, all who wait have as many as one tenant may.
    free: usize,
    /// Places that one tenant may have.
    of_one: usize,
    /// Places that each tenant has; none of them 0.
    running: HashMap<Tenant, usize>,
    /// Tenants that wait, whose turn is next first; each has a queue.
    ring: VecDeque<Tenant>,
    queues: HashMap<Tenant, VecDeque<oneshot::Sender<Place>>>,
}

/// The right to work, given up when dropped.
struct Place {
    bounded: Bounded,
    kind: Kind,
    tenant: Tenant,
}

/// A piece of work under way.
struct Piece {
    bounded: Bounded,
    tenant: Tenant,
    /// Closed once the caller is gone.
    caller: watch::Receiver<()>,
    /// Why this one may not go on: too many long pieces wait.
    refused: OnceLock<ServiceError>,
    /// `None` while it waits.
    place: Mutex<Option<(Place, Instant)>>,
}

impl Bounded {
    pub fn new(name: &'static str, Size { first, long }: Size, wait: Duration) -> Self {
        let line = |free, of_one| {
            let (running, queues) = (HashMap::new(), HashMap::new());
            Mutex::new(Line { free, of_one, running, ring: VecDeque::new(), queues })
        };
        let of_one = first.div_ceil(2);
        Bounded { name, of_one, lines: Arc::new([line(first, of_one), line(long, long)]), wait }
    }

    /// Runs `work` on a thread that may block. It ends early where the future is dropped.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if no place became free in time, [`Refused::OwnWork`] if the tenant had all it may have; a panic
    /// of `work`.
    pub async fn run<T: Send + 'static>(
        &self,
        tenant: &Tenant,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        self.run_and_prepare(tenant, move || (work(), || ())).await
    }

    /// Runs `work` as [`Self::run`] does. It returns the answer and a preparation for later calls, which runs in the same
    /// place once the caller has the answer.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub async fn run_and_prepare<T: Send + 'static, P: FnOnce()>(
        &self,
        tenant: &Tenant,
        work: impl FnOnce() -> (T, P) + Send + 'static,
    ) -> Result<T, ServiceError> {
        let place = self.first_place(tenant).instrument(spans::of_turn()).await?;
        let (here, caller) = watch::channel(());
        let piece = Arc::new(Piece {
            bounded: self.clone(),
            tenant: tenant.clone(),
            caller,
            refused: OnceLock::new(),
            place: Mutex::new(Some((place, Instant::now()))),
        });
        let (done, answer) = oneshot::channel();
        tokio::task::spawn_blocking(move || {
            // Nobody receives the answer if the caller went away.
            match interruption::watched(piece.clone(), work) {
                Ok((answer, prepare)) => {
                    let _ = done.send(Ok(answer));
                    prepare();
                }
                Err(Stopped) => {
                    let refused = Arc::into_inner(piece).and_then(|piece| piece.refused.into_inner());
                    drop(done.send(Err(refused.unwrap_or(ServiceError::Busy))));
                }
            }
        });
        let answer = answer.instrument(spans::of_work(self.name)).await.map_err(ServiceError::internal)?;
        drop(here);
        answer
    }

    /// Pieces that wait for a place.
    pub fn waiting(&self) -> usize {
        [Kind::First, Kind::Long].map(|kind| self.line(kind).waiting()).into_iter().sum()
    }

    async fn first_place(&self, tenant: &Tenant) -> Result<Place, ServiceError> {
        let asked = self.line(Kind::First).ask(tenant);
        let Some(granted) = asked else { return Ok(self.place(Kind::First, tenant.clone())) };
        let granted = tokio::time::timeout(self.wait, granted).await;
        let late = |_| {
            let line = self.line(Kind::First);
            let is_own = line.running.contains_key(tenant) && line.is_full_of(tenant);
            if is_own { Refused::OwnWork.into() } else { ServiceError::Busy }
        };
        granted.map_err(late)?.map_err(ServiceError::internal)
    }

    fn place(&self, kind: Kind, tenant: Tenant) -> Place {
        Place { bounded: self.clone(), kind, tenant }
    }

    fn line(&self, kind: Kind) -> MutexGuard<'_, Line> {
        // No code panics while holding the lock.
        self.lines[kind as usize].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let next = self.bounded.line(self.kind).give_back(&self.tenant);
        if let Some((tenant, waiting)) = next {
            // Whoever stopped waiting in this instant drops it, and so hands it on.
            drop(waiting.send(self.bounded.place(self.kind, tenant)));
        }
    }
}

impl Watcher for Piece {
    fn is_stopped(&self) -> bool {
        self.refused.get().is_some() || self.caller.has_changed().is_err()
    }

    fn give_way(&self) {
        let mut held = self.place.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((Place { kind, .. }, since)) = &mut *held else { return };
        let share = if *kind == Kind::First { MOMENT } else { SHIFT };
        if since.elapsed() < share {
            return;
        }
        let granted = {
            let mut line = self.bounded.line(Kind::Long);
            let waiting = line.waiting();
            if *kind == Kind::Long && waiting == 0 {
                *since = Instant::now();
                return;
            }
            let refused = if line.waiting_of(&self.tenant) >= LONG_WAITING_OF_ONE {
                Some(Refused::OwnWork.into())
            } else {
                (waiting >= LONG_WAITING).then_some(ServiceError::Busy)
            };
            if let Some(refused) = refused {
                self.refused.get_or_init(|| refused);
                return;
            }
            line.ask(&self.tenant)
        };
        *held = None;
        let place = match granted {
            None => Some(self.bounded.place(Kind::Long, self.tenant.clone())),
            Some(granted) => self.wait_for(granted),
        };
        *held = place.map(|place| (place, Instant::now()));
    }
}

impl Piece {
    /// `None` where the caller went away first.
    fn wait_for(&self, granted: oneshot::Receiver<Place>) -> Option<Place> {
        let mut caller = self.caller.clone();
        Handle::current().block_on(async {
            tokio::select! {
                granted = granted => granted.ok(),
                _ = caller.changed() => None,
            }
        })
    }
}

impl Line {
    fn may(&self, tenant: &Tenant) -> bool {
        self.free > 0 && !self.is_full_of(tenant)
    }

    /// Whether the tenant has as many places as it may.
    fn is_full_of(&self, tenant: &Tenant) -> bool {
        self.running.get(tenant).copied().unwrap_or_default() >= self.of_one
    }

    fn take(&mut self, tenant: &Tenant) {
        self.free -= 1;
        *self.running.entry(tenant.clone()).or_default() += 1;
    }

    /// Takes a place if there is one for the tenant: `None`. Else waits for it.
    fn ask(&mut self, tenant: &Tenant) -> Option<oneshot::Receiver<Place>> {
        if self.may(tenant) {
            self.take(tenant);
            return None;
        }
        let (waiting, granted) = oneshot::channel();
        let queue = self.queues.entry(tenant.clone()).or_default();
        if queue.is_empty() {
            self.ring.push_back(tenant.clone());
        }
        queue.push_back(waiting);
        Some(granted)
    }

    /// Whoever has the place of the tenant next, who goes to the end of the ring.
    fn give_back(&mut self, tenant: &Tenant) -> Option<(Tenant, oneshot::Sender<Place>)> {
        self.free += 1;
        if let Some(running) = self.running.get_mut(tenant) {
            *running -= 1;
            if *running == 0 {
                self.running.remove(tenant);
            }
        }
        for _ in 0..self.ring.len() {
            let tenant = self.ring.pop_front()?;
            if !self.may(&tenant) {
                self.ring.push_back(tenant);
                continue;
            }
            let Some(queue) = self.queues.get_mut(&tenant) else { continue };
            queue.retain(|waiting| !waiting.is_closed());
            let first = queue.pop_front();
            if queue.is_empty() {
                self.queues.remove(&tenant);
            } else {
                self.ring.push_back(tenant.clone());
            }
            if let Some(first) = first {
                self.take(&tenant);
                return Some((tenant, first));
            }
        }
        None
    }

    fn waiting(&self) -> usize {
        self.queues.keys().map(|tenant| self.waiting_of(tenant)).sum()
    }

    fn waiting_of(&self, tenant: &Tenant) -> usize {
        self.queues.get(tenant).map_or(0, |queue| queue.iter().filter(|waiting| !waiting.is_closed()).count())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::sync::mpsc;

    use super::*;

    fn tenant(name: &str) -> Tenant {
        name.parse().unwrap()
    }

    fn bounded(first: usize, long: usize) -> Bounded {
        Bounded::new("work", Size { first, long }, Duration::from_secs(60))
    }

    /// Work that ends when told to, and says what it is when it begins.
    struct Held {
        release: mpsc::Sender<()>,
        done: tokio::task::JoinHandle<Result<bool, ServiceError>>,
    }

    fn hold(bounded: &Bounded, of: &str, begun: &mpsc::Sender<String>, name: &str) -> Held {
        let ((release, held), bounded, of) = (mpsc::channel::<()>(), bounded.clone(), tenant(of));
        let (begun, name) = (begun.clone(), name.to_owned());
        let work = move || begun.send(name).is_ok() && held.recv().is_ok();
        Held { release, done: tokio::spawn(async move { bounded.run(&of, work).await }) }
    }

    /// Work that passes checkpoints and counts them, until `enough`.
    fn busy(
        bounded: &Bounded,
        of: &str,
        enough: u64,
    ) -> (Arc<AtomicU64>, tokio::task::JoinHandle<Result<(), ServiceError>>) {
        let (passed, bounded, of) = (Arc::new(AtomicU64::new(0)), bounded.clone(), tenant(of));
        let counted = passed.clone();
        let work = move || {
            while counted.load(Ordering::Relaxed) < enough {
                interruption::checkpoint();
                std::thread::sleep(Duration::from_millis(1));
                counted.fetch_add(1, Ordering::Relaxed);
            }
        };
        (passed, tokio::spawn(async move { bounded.run(&of, work).await }))
    }

    /// Waits until every place is free: of so many of each kind.
    async fn all_free(bounded: &Bounded, places: [usize; 2]) {
        let is_free = |(kind, places): (Kind, usize)| {
            let line = bounded.line(kind);
            line.free == places && line.ring.is_empty() && line.queues.is_empty() && line.running.is_empty()
        };
        until(|| [Kind::First, Kind::Long].into_iter().zip(places).all(is_free)).await;
    }

    async fn until(mut reached: impl FnMut() -> bool) {
        while !reached() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    #[tokio::test]
    async fn work_past_the_bound_is_refused_and_done_once_there_is_room() {
        let bounded = Bounded::new("work", Size { first: 1, long: 1 }, Duration::from_millis(20));
        let (begun, begins) = mpsc::channel();
        let first = hold(&bounded, "north", &begun, "first");
        until(|| begins.try_recv().is_ok()).await;
        let refused = bounded.run(&tenant("north"), || ()).await;
        assert!(matches!(refused, Err(ServiceError::Refused(Refused::OwnWork))), "{refused:?}");
        let refused = bounded.run(&tenant("south"), || ()).await;
        assert!(matches!(refused, Err(ServiceError::Busy)), "{refused:?}");
        assert_eq!(bounded.waiting(), 0);
        first.release.send(()).unwrap();
        assert!(first.done.await.unwrap().unwrap());
        assert_eq!(bounded.run(&tenant("north"), || 7).await.unwrap(), 7);
        all_free(&bounded, [1, 1]).await;
    }

    #[tokio::test]
    async fn a_queue_of_one_tenant_puts_off_another_by_one_turn() {
        let bounded = bounded(1, 1);
        let (begun, begins) = mpsc::channel();
        let mut held = HashMap::new();
        for number in 0..5 {
            let name = format!("north {number}");
            held.insert(name.clone(), hold(&bounded, "north", &begun, &name));
            until(|| bounded.waiting() == number).await;
        }
        for number in 0..2 {
            let name = format!("south {number}");
            held.insert(name.clone(), hold(&bounded, "south", &begun, &name));
            until(|| bounded.waiting() == 5 + number).await;
        }
        let mut order: Vec<String> = Vec::new();
        while !held.is_empty() {
            match begins.try_recv() {
                Ok(name) => {
                    held.remove(&name).unwrap().release.send(()).unwrap();
                    order.push(name);
                }
                Err(_) => tokio::task::yield_now().await,
            }
        }
        assert_eq!(order, ["north 0", "north 1", "south 0", "north 2", "south 1", "north 3", "north 4"]);
    }

    #[tokio::test]
    async fn one_tenant_leaves_half_of_the_places() {
        let bounded = bounded(2, 1);
        let (begun, begins) = mpsc::channel();
        let held = [0, 1].map(|number| hold(&bounded, "north", &begun, &number.to_string()));
        until(|| bounded.waiting() == 1).await;
        assert_eq!(bounded.run(&tenant("south"), || 7).await.unwrap(), 7);
        assert_eq!((begins.try_iter().count(), bounded.waiting()), (1, 1));
        held.iter().for_each(|held| held.release.send(()).unwrap());
        for held in held {
            assert!(held.done.await.unwrap().unwrap());
        }
        all_free(&bounded, [2, 1]).await;
    }

    /// The first moment over, long pieces share one place, and what begins meanwhile begins at once.
    #[tokio::test]
    async fn long_work_leaves_its_place_and_takes_turns() {
        let bounded = bounded(1, 1);
        let (north, north_done) = busy(&bounded, "north", u64::MAX);
        let (south, south_done) = busy(&bounded, "south", u64::MAX);
        let (east, east_done) = busy(&bounded, "east", 20);
        east_done.await.unwrap().unwrap();
        assert_eq!(east.load(Ordering::Relaxed), 20);
        for piece in [&north, &south, &north, &south] {
            let before = piece.load(Ordering::Relaxed);
            until(|| piece.load(Ordering::Relaxed) > before + 10).await;
        }
        for done in [north_done, south_done] {
            done.abort();
            assert!(done.await.unwrap_err().is_cancelled());
        }
        all_free(&bounded, [1, 1]).await;
    }

    #[tokio::test]
    async fn long_work_of_one_tenant_is_bounded() {
        let bounded = bounded(1, 1);
        let mut all: Vec<_> = (0..LONG_WAITING_OF_ONE + 2).map(|_| busy(&bounded, "north", u64::MAX).1).collect();
        until(|| all.iter().any(tokio::task::JoinHandle::is_finished)).await;
        let first = all.iter().position(tokio::task::JoinHandle::is_finished).unwrap();
        let refused = all.swap_remove(first).await.unwrap();
        assert!(matches!(refused, Err(ServiceError::Refused(Refused::OwnWork))), "{refused:?}");
        assert!(busy(&bounded, "south", 500).1.await.unwrap().is_ok());
        all.iter().for_each(tokio::task::JoinHandle::abort);
        all_free(&bounded, [1, 1]).await;
    }

    #[tokio::test]
    async fn work_whose_caller_went_away_ends() {
        let bounded = bounded(1, 1);
        let (passed, done) = busy(&bounded, "north", u64::MAX);
        until(|| passed.load(Ordering::Relaxed) > 0).await;
        done.abort();
        until(|| bounded.line(Kind::First).free == 1).await;
        let ended = passed.load(Ordering::Relaxed);
        tokio::time::sleep(Duration::from_millis(30)).await;
        assert_eq!(passed.load(Ordering::Relaxed), ended);
    }

    #[tokio::test]
    async fn who_went_away_is_passed_over() {
        let bounded = bounded(1, 1);
        let (begun, begins) = mpsc::channel();
        let first = hold(&bounded, "north", &begun, "first");
        until(|| begins.try_recv().is_ok()).await;
        let gone = hold(&bounded, "south", &begun, "gone");
        until(|| bounded.waiting() == 1).await;
        gone.done.abort();
        until(|| bounded.waiting() == 0).await;
        let last = hold(&bounded, "east", &begun, "last");
        until(|| bounded.waiting() == 1).await;
        first.release.send(()).unwrap();
        last.release.send(()).unwrap();
        assert!(first.done.await.unwrap().unwrap() && last.done.await.unwrap().unwrap());
        all_free(&bounded, [1, 1]).await;
    }
}
