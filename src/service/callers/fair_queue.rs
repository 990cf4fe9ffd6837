//! Work that requests cause, bounded and shared fairly between tenants.
//!
//! A piece of work begins with a permit of the first stage and keeps it for 100 ms. A tenant may hold half of these
//! permits at most. Longer work continues in the second stage, which has fewer permits than there are processors, in
//! turns of 100 ms. Every second turn goes to the piece that has worked least, the others go to one tenant after the
//! other. So a short question waits for moments only, however long the questions of others are, and long questions
//! share what is left. A question about a long record begins in the second stage, because measuring its radius takes
//! longer than a moment and cannot be interrupted. Each stage has a queue for every tenant.
//!
//! The queue of the second stage is bounded. When it is full, the tenant with the most pieces in it loses one; if every
//! tenant has one, the piece that has worked longest is refused.
//!
//! A piece whose caller is gone, by a time limit, a closed connection or the end of the service, ends at its next
//! checkpoint (see [`interruption`]). A piece that waits too long for a permit of the first stage is refused.
//! Checked by: the tests below and `tests/operation/interruption.rs`.

mod stage;

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{oneshot, watch};
use tracing::Instrument;

use self::stage::{Stage, StageQueue, TURN, rank};
use crate::numerics::machine::interruption::{self, Stopped, Watcher};
use crate::service::callers::allowance::Refused;
use crate::service::error::ServiceError;
use crate::service::process::spans;
use crate::store::Tenant;

/// Pieces that may wait in the second stage.
pub(in crate::service) const LONG_WAITING: usize = 16;
/// The measurement of the radius of a record with more returns takes longer than the first stage.
const LONG_RECORD: usize = 1000;

/// Runs blocking work, with a limit on how much of it runs at a time.
#[derive(Clone)]
pub struct FairQueue {
    /// The name of the work in traces and metrics.
    pub name: &'static str,
    /// The most pieces of one tenant in the first stage at a time: half of all permits, so that some are left for
    /// others.
    pub of_one: usize,
    queues: Arc<[Mutex<StageQueue<Granted>>; 2]>,
    wait: Duration,
}

/// How many pieces of work may be under way.
#[derive(Debug, Clone, Copy)]
pub struct QueueSize {
    /// In the first stage.
    pub first: usize,
    /// In the second stage.
    pub long: usize,
}

/// The answer to a waiting piece.
type Granted = Result<Permit, ServiceError>;

/// The right to work, given up when dropped.
struct Permit {
    queue: FairQueue,
    stage: Stage,
    tenant: Tenant,
}

/// A piece of work under way.
struct Piece {
    queue: FairQueue,
    tenant: Tenant,
    /// Closed once the caller is gone.
    caller: watch::Receiver<()>,
    /// Why it may not go on: too many pieces wait.
    refused: OnceLock<ServiceError>,
    held: Mutex<PieceState>,
}

/// The permit of a piece and the time it has worked.
struct PieceState {
    /// `None` while it waits.
    place: Option<Permit>,
    since: Instant,
    /// The time it worked before.
    before: Duration,
}

impl FairQueue {
    pub fn new(name: &'static str, QueueSize { first, long }: QueueSize, wait: Duration) -> Self {
        let of_one = first.div_ceil(2);
        // In the first stage the time that a caller waits is bounded, not the number of those that wait.
        let stages = [StageQueue::new(first, of_one, usize::MAX), StageQueue::new(long, long, LONG_WAITING)];
        FairQueue { name, of_one, queues: Arc::new(stages.map(Mutex::new)), wait }
    }

    /// Runs `work` on a thread that may block. It ends early if the future is dropped.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if no permit became free in time, [`Refused::OwnWork`] if the tenant held all that it
    /// may; a panic of `work`.
    pub async fn run<T: Send + 'static>(
        &self,
        tenant: &Tenant,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        self.run_and_prepare(tenant, move || (work(), || ())).await
    }

    /// Runs `work` as [`Self::run`] does. The work returns the answer and a preparation for later calls, which runs
    /// under the same permit once the caller has the answer.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub async fn run_and_prepare<T: Send + 'static, P: FnOnce()>(
        &self,
        tenant: &Tenant,
        work: impl FnOnce() -> (T, P) + Send + 'static,
    ) -> Result<T, ServiceError> {
        self.run_from(Stage::First, tenant, work).await
    }

    /// Runs `work` on a record of so many returns as [`Self::run`] does.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub async fn run_on_record<T: Send + 'static>(
        &self,
        tenant: &Tenant,
        returns: usize,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let stage = if returns > LONG_RECORD { Stage::Long } else { Stage::First };
        self.run_from(stage, tenant, move || (work(), || ())).await
    }

    async fn run_from<T: Send + 'static, P: FnOnce()>(
        &self,
        stage: Stage,
        tenant: &Tenant,
        work: impl FnOnce() -> (T, P) + Send + 'static,
    ) -> Result<T, ServiceError> {
        let place = self.begin(stage, tenant).instrument(spans::of_turn()).await?;
        let (here, caller) = watch::channel(());
        let held = PieceState { place: Some(place), since: Instant::now(), before: stage.begins() };
        let piece = Arc::new(Piece {
            queue: self.clone(),
            tenant: tenant.clone(),
            caller,
            refused: OnceLock::new(),
            held: Mutex::new(held),
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

    /// Returns the number of pieces that wait for a permit.
    pub fn waiting(&self) -> usize {
        [Stage::First, Stage::Long].map(|stage| self.stage(stage).waiting()).into_iter().sum()
    }

    /// Waits for a permit to begin with.
    async fn begin(&self, stage: Stage, tenant: &Tenant) -> Result<Permit, ServiceError> {
        let Some(granted) = self.ask(stage, tenant, 0)? else { return Ok(self.place(stage, tenant.clone())) };
        if stage == Stage::Long {
            return granted.await.map_err(ServiceError::internal)?;
        }
        let late = |_| {
            let queue = self.stage(stage);
            too_many(if queue.is_full_of(tenant) { queue.running_of(tenant) } else { 0 })
        };
        tokio::time::timeout(self.wait, granted).await.map_err(late)?.map_err(ServiceError::internal)?
    }

    /// Takes a permit and returns `None` if there is one for the tenant; otherwise queues for one.
    ///
    /// # Errors
    /// The queue is full, and no other piece has to make room.
    fn ask(
        &self,
        stage: Stage,
        tenant: &Tenant,
        rank: u128,
    ) -> Result<Option<oneshot::Receiver<Granted>>, ServiceError> {
        let mut queue = self.stage(stage);
        if queue.is_full() {
            let Some((grant, left)) = queue.give_up_one(tenant, rank) else {
                return Err(too_many(queue.waiting_of(tenant)));
            };
            drop(grant.send(Err(too_many(left))));
        }
        Ok(queue.ask(tenant, rank))
    }

    fn place(&self, stage: Stage, tenant: Tenant) -> Permit {
        Permit { queue: self.clone(), stage, tenant }
    }

    fn stage(&self, stage: Stage) -> MutexGuard<'_, StageQueue<Granted>> {
        // No code panics while holding the lock.
        self.queues[stage as usize].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        let next = self.queue.stage(self.stage).give_back(&self.tenant);
        if let Some((tenant, grant)) = next {
            // A piece that stopped waiting in this instant drops the permit, which hands it on.
            drop(grant.send(Ok(self.queue.place(self.stage, tenant))));
        }
    }
}

impl Watcher for Piece {
    fn is_stopped(&self) -> bool {
        self.refused.get().is_some() || self.caller.has_changed().is_err()
    }

    fn give_way(&self) {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let worked = held.since.elapsed();
        if held.place.is_none() || worked < TURN {
            return;
        }
        held.before += worked;
        held.since = Instant::now();
        // Given up first, so that another piece may have it.
        held.place = None;
        let place = match self.queue.ask(Stage::Long, &self.tenant, rank(held.before)) {
            Ok(None) => Ok(self.queue.place(Stage::Long, self.tenant.clone())),
            Ok(Some(granted)) => {
                let Some(granted) = self.wait_for(granted) else { return };
                held.since = Instant::now();
                granted
            }
            Err(refused) => Err(refused),
        };
        match place {
            Ok(place) => held.place = Some(place),
            Err(refused) => drop(self.refused.set(refused)),
        }
    }
}

/// Returns the refusal of a piece for which there is no room, when its tenant has `own` others there.
fn too_many(own: usize) -> ServiceError {
    if own > 0 { Refused::OwnWork.into() } else { ServiceError::Busy }
}

impl Piece {
    /// Waits for a permit or a refusal; `None` if the caller goes away first.
    fn wait_for(&self, granted: oneshot::Receiver<Granted>) -> Option<Granted> {
        let mut caller = self.caller.clone();
        Handle::current().block_on(async {
            tokio::select! {
                granted = granted => granted.ok(),
                _ = caller.changed() => None,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::sync::mpsc;

    use super::*;

    fn tenant(name: &str) -> Tenant {
        name.parse().unwrap()
    }

    fn bounded(first: usize, long: usize) -> FairQueue {
        FairQueue::new("work", QueueSize { first, long }, Duration::from_secs(60))
    }

    /// Work that ends when told to, and says what it is when it begins.
    struct Task {
        release: mpsc::Sender<()>,
        done: tokio::task::JoinHandle<Result<bool, ServiceError>>,
    }

    fn hold(bounded: &FairQueue, of: &str, begun: &mpsc::Sender<String>, name: &str) -> Task {
        let ((release, held), bounded, of) = (mpsc::channel::<()>(), bounded.clone(), tenant(of));
        let (begun, name) = (begun.clone(), name.to_owned());
        let work = move || begun.send(name).is_ok() && held.recv().is_ok();
        Task { release, done: tokio::spawn(async move { bounded.run(&of, work).await }) }
    }

    /// Work that passes checkpoints and counts them, until `enough`.
    fn busy(
        bounded: &FairQueue,
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

    /// Waits until every permit is free: the given numbers of the first stage and of the second.
    async fn all_free(bounded: &FairQueue, [first, long]: [usize; 2]) {
        let is_free = |(stage, places): (Stage, usize)| {
            let queue = bounded.stage(stage);
            queue.free == places && queue.ring.is_empty() && queue.queues.is_empty() && queue.running.is_empty()
        };
        let stages = [(Stage::First, first), (Stage::Long, long)];
        until(|| stages.into_iter().all(is_free)).await;
    }

    async fn until(mut reached: impl FnMut() -> bool) {
        while !reached() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    #[tokio::test]
    async fn work_past_the_bound_is_refused_and_done_once_there_is_room() {
        let bounded = FairQueue::new("work", QueueSize { first: 1, long: 1 }, Duration::from_millis(20));
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

    /// Once their first turn is over, long pieces share one permit, and a piece that begins meanwhile begins at once.
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

    /// A tenant fills the queue; the next piece of its own is refused, and one of another tenant replaces a piece in
    /// it.
    #[tokio::test]
    async fn a_full_queue_takes_from_the_tenant_with_most() {
        let bounded = bounded(1, 1);
        let mut all: Vec<_> = (0..LONG_WAITING + 3).map(|_| busy(&bounded, "north", u64::MAX).1).collect();
        until(|| all.iter().any(tokio::task::JoinHandle::is_finished)).await;
        let first = all.iter().position(tokio::task::JoinHandle::is_finished).unwrap();
        let refused = all.swap_remove(first).await.unwrap();
        assert!(matches!(refused, Err(ServiceError::Refused(Refused::OwnWork))), "{refused:?}");
        assert!(busy(&bounded, "south", 500).1.await.unwrap().is_ok());
        all.iter().for_each(tokio::task::JoinHandle::abort);
        all_free(&bounded, [1, 1]).await;
    }

    /// Many tenants have a long piece each, and a short one is hardly delayed.
    #[tokio::test]
    async fn a_short_piece_goes_before_long_ones_however_many_there_are() {
        let bounded = bounded(1, 1);
        let name = |number: usize| format!("tenant-{number}");
        let all: Vec<_> = (0..LONG_WAITING).map(|number| busy(&bounded, &name(number), u64::MAX)).collect();
        // All of them have had a turn in each stage, 100 checkpoints and less each.
        until(|| all.iter().all(|(passed, _)| passed.load(Ordering::Relaxed) > 200)).await;
        let of_all = || all.iter().map(|(passed, _)| passed.load(Ordering::Relaxed)).sum::<u64>();
        for _ in 0..5 {
            let before = of_all();
            assert!(busy(&bounded, "south", 150).1.await.unwrap().is_ok());
            // About as many checkpoints beside it, and one turn of another; in turn over all it would be some thousands.
            let passed = of_all() - before;
            assert!(passed < 1000, "{passed}");
        }
        all.iter().for_each(|(_, done)| done.abort());
        all_free(&bounded, [1, 1]).await;
    }

    /// A question about a long record that cannot be interrupted takes no permit of the first stage.
    #[tokio::test]
    async fn a_long_record_begins_in_the_second_stage() {
        let bounded = bounded(1, 1);
        let ((release, held), begun) = (mpsc::channel::<()>(), bounded.clone());
        let long = tokio::spawn(async move {
            begun.run_on_record(&tenant("north"), LONG_RECORD + 1, move || held.recv().is_ok()).await
        });
        until(|| bounded.stage(Stage::Long).running.contains_key(&tenant("north"))).await;
        assert_eq!(bounded.run_on_record(&tenant("north"), LONG_RECORD, || 7).await.unwrap(), 7);
        release.send(()).unwrap();
        assert!(long.await.unwrap().unwrap());
        all_free(&bounded, [1, 1]).await;
    }

    #[tokio::test]
    async fn work_whose_caller_went_away_ends() {
        let bounded = bounded(1, 1);
        let (passed, done) = busy(&bounded, "north", u64::MAX);
        until(|| passed.load(Ordering::Relaxed) > 0).await;
        done.abort();
        until(|| bounded.stage(Stage::First).free == 1).await;
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
