//! Work that requests cause, bounded and taken in turn over tenants.
//!
//! There are common places, which anybody takes while they are free, and a few more for guests: tenants none of whose work
//! is under way. Whoever finds no place waits in his tenant's queue, and a place that becomes free goes to the tenants in
//! turn. So how much one tenant has queued changes nothing for another, and one that is alone with his question begins at
//! once beside a long piece of another's: work cannot be interrupted, but the processors are shared by the system, which is
//! the only fair turn there is with one common place and a piece of half a second in it.
//!
//! Who has waited too long is told to come back. Not done, and why: turns weighed by how long a tenant's pieces take (a
//! tenant of long pieces gets more than his share of the common places, and delays nobody else's first piece).

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::oneshot;
use tracing::Instrument;

use super::error::ServiceError;
use super::spans;
use crate::store::Tenant;

/// Runs blocking work, so much of it at a time.
#[derive(Clone)]
pub(super) struct Bounded {
    /// What the work is, in traces and metrics.
    pub name: &'static str,
    turns: Arc<Mutex<Turns>>,
    wait: Duration,
}

/// How many pieces of work may be under way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Size {
    /// Of anybody.
    pub common: usize,
    /// Of tenants with nothing else under way, beyond the common ones.
    pub guests: usize,
}

struct Turns {
    size: Size,
    /// Work under way, by tenant; none of them 0.
    running: HashMap<Tenant, usize>,
    /// Tenants that wait, whose turn is next first; each has a queue.
    ring: VecDeque<Tenant>,
    queues: HashMap<Tenant, VecDeque<oneshot::Sender<Place>>>,
}

/// The right to work, given up when dropped.
struct Place {
    bounded: Bounded,
    tenant: Tenant,
}

impl Bounded {
    pub(super) fn new(name: &'static str, size: Size, wait: Duration) -> Self {
        let turns = Turns { size, running: HashMap::new(), ring: VecDeque::new(), queues: HashMap::new() };
        Bounded { name, turns: Arc::new(Mutex::new(turns)), wait }
    }

    /// Runs `work` on a thread that may block. Its place is taken until it ends, even where the caller goes away.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] where no place became free in time; a panic of `work`.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        tenant: &Tenant,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let place = self.place(tenant).instrument(spans::of_turn()).await?;
        let working = tokio::task::spawn_blocking(move || {
            let answer = work();
            drop(place);
            answer
        });
        working.instrument(spans::of_work(self.name)).await.map_err(ServiceError::internal)
    }

    /// Pieces that may be under way at a time, those of guests aside.
    pub(super) fn places(&self) -> usize {
        self.lock().size.common
    }

    /// Requests that wait for a place.
    pub(super) fn waiting(&self) -> usize {
        let turns = self.lock();
        turns.queues.values().flatten().filter(|waiting| !waiting.is_closed()).count()
    }

    async fn place(&self, tenant: &Tenant) -> Result<Place, ServiceError> {
        let granted = {
            let mut turns = self.lock();
            if turns.take(tenant) {
                return Ok(Place { bounded: self.clone(), tenant: tenant.clone() });
            }
            turns.queue(tenant)
        };
        let granted = tokio::time::timeout(self.wait, granted).await;
        granted.map_err(|_| ServiceError::Busy)?.map_err(ServiceError::internal)
    }

    fn lock(&self) -> MutexGuard<'_, Turns> {
        // No code panics while holding the lock.
        self.turns.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let granted = {
            let mut turns = self.bounded.lock();
            turns.give_up(&self.tenant);
            turns.next()
        };
        if let Some((tenant, waiting)) = granted {
            // Who stopped waiting in this instant drops it, and so hands it on.
            drop(waiting.send(Place { bounded: self.bounded.clone(), tenant }));
        }
    }
}

impl Turns {
    fn may(&self, tenant: &Tenant) -> bool {
        let running: usize = self.running.values().sum();
        let is_guest = !self.running.contains_key(tenant);
        running < self.size.common || (is_guest && running < self.size.common + self.size.guests)
    }

    /// Takes a place where there is one, and nobody has waited longer for it.
    fn take(&mut self, tenant: &Tenant) -> bool {
        let free = self.may(tenant) && !self.queues.contains_key(tenant);
        if free {
            *self.running.entry(tenant.clone()).or_default() += 1;
        }
        free
    }

    fn queue(&mut self, tenant: &Tenant) -> oneshot::Receiver<Place> {
        let (waiting, granted) = oneshot::channel();
        let queue = self.queues.entry(tenant.clone()).or_default();
        if queue.is_empty() {
            self.ring.push_back(tenant.clone());
        }
        queue.retain(|waiting| !waiting.is_closed());
        queue.push_back(waiting);
        granted
    }

    fn give_up(&mut self, tenant: &Tenant) {
        if let Some(running) = self.running.get_mut(tenant) {
            *running -= 1;
            if *running == 0 {
                self.running.remove(tenant);
            }
        }
    }

    /// Takes the place that became free for whoever is next; the tenant goes to the end of the ring.
    fn next(&mut self) -> Option<(Tenant, oneshot::Sender<Place>)> {
        let mut skipped = VecDeque::new();
        let mut found = None;
        while let Some(tenant) = self.ring.pop_front() {
            if !self.may(&tenant) {
                skipped.push_back(tenant);
                continue;
            }
            let Some(waiting) = self.first(&tenant) else { continue };
            *self.running.entry(tenant.clone()).or_default() += 1;
            if self.queues.contains_key(&tenant) {
                self.ring.push_back(tenant.clone());
            }
            found = Some((tenant, waiting));
            break;
        }
        skipped.append(&mut self.ring);
        self.ring = skipped;
        found
    }

    /// The first of a tenant who still waits; without anybody left the queue is gone.
    fn first(&mut self, tenant: &Tenant) -> Option<oneshot::Sender<Place>> {
        let queue = self.queues.get_mut(tenant)?;
        queue.retain(|waiting| !waiting.is_closed());
        let first = queue.pop_front();
        if queue.is_empty() {
            self.queues.remove(tenant);
        }
        first
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    fn tenant(name: &str) -> Tenant {
        name.parse().unwrap()
    }

    fn bounded(common: usize, guests: usize) -> Bounded {
        Bounded::new("work", Size { common, guests }, Duration::from_secs(60))
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

    async fn until(mut reached: impl FnMut() -> bool) {
        while !reached() {
            tokio::task::yield_now().await;
        }
    }

    #[tokio::test]
    async fn work_past_the_bound_is_refused_and_done_once_there_is_room() {
        let bounded = Bounded::new("work", Size { common: 1, guests: 0 }, Duration::from_millis(20));
        let (begun, begins) = mpsc::channel();
        let first = hold(&bounded, "north", &begun, "first");
        until(|| begins.try_recv().is_ok()).await;
        assert!(matches!(bounded.run(&tenant("north"), || ()).await, Err(ServiceError::Busy)));
        assert_eq!(bounded.waiting(), 0);
        first.release.send(()).unwrap();
        assert!(first.done.await.unwrap().unwrap());
        assert_eq!(bounded.run(&tenant("north"), || 7).await.unwrap(), 7);
        assert!(bounded.lock().running.is_empty() && bounded.lock().queues.is_empty());
    }

    #[tokio::test]
    async fn a_queue_of_one_tenant_puts_off_another_by_one_turn() {
        let bounded = bounded(1, 0);
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
    async fn a_tenant_alone_with_his_question_does_not_wait_for_anothers() {
        let bounded = bounded(1, 1);
        let (begun, begins) = mpsc::channel();
        let held = [0, 1].map(|number| hold(&bounded, "north", &begun, &number.to_string()));
        until(|| bounded.waiting() == 1).await;
        assert_eq!(bounded.run(&tenant("south"), || 7).await.unwrap(), 7);
        let mut first = None;
        until(|| {
            first = begins.try_recv().ok();
            first.is_some()
        })
        .await;
        // The place of guests is not for those who have one.
        assert_eq!((first.as_deref(), begins.try_recv().is_err(), bounded.waiting()), (Some("0"), true, 1));
        held.iter().for_each(|held| held.release.send(()).unwrap());
        for held in held {
            assert!(held.done.await.unwrap().unwrap());
        }
    }

    #[tokio::test]
    async fn who_went_away_is_passed_over() {
        let bounded = bounded(1, 0);
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
        assert!(bounded.lock().running.is_empty() && bounded.lock().queues.is_empty());
    }
}
