//! The stages of work, and the queue of each: which piece of work gets a permit that becomes free, and which one leaves
//! a full queue.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use tokio::sync::oneshot;

use crate::store::Tenant;

/// How long a piece of work keeps its permit while others wait. Most pieces end within it.
pub(super) const TURN: Duration = Duration::from_millis(100);

/// The stage that a piece of work has reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    First,
    Long,
}

impl Stage {
    /// Returns how long a piece counts as having worked when it enters.
    pub fn begins(self) -> Duration {
        match self {
            Stage::First => Duration::ZERO,
            Stage::Long => TURN,
        }
    }
}

/// Returns the rank of a piece that has worked for the time `worked`. The piece of the lowest rank has worked least.
pub(super) fn rank(worked: Duration) -> u128 {
    worked.as_millis() / TURN.as_millis()
}

/// The permits of one stage, and the pieces that wait for them.
pub(super) struct StageQueue<G> {
    /// Permits that nobody holds. While there are any, every tenant that waits holds as many as one tenant may.
    pub free: usize,
    /// Permits that one tenant may hold.
    of_one: usize,
    /// The most pieces that may wait.
    most_waiting: usize,
    /// Permits that each tenant holds; tenants without any are left out.
    pub running: HashMap<Tenant, usize>,
    /// Tenants that wait, the one whose turn is next first. Each has a queue.
    pub ring: VecDeque<Tenant>,
    pub queues: HashMap<Tenant, VecDeque<WaitingPiece<G>>>,
    /// True if the next permit goes to the tenant whose turn it is, and not to the piece that has worked least.
    goes_round: bool,
}

/// A piece that waits for a permit.
pub(super) struct WaitingPiece<G> {
    rank: u128,
    grant: oneshot::Sender<G>,
}

impl<G> StageQueue<G> {
    pub fn new(free: usize, of_one: usize, most_waiting: usize) -> Self {
        let (running, queues) = (HashMap::new(), HashMap::new());
        StageQueue { free, of_one, most_waiting, running, ring: VecDeque::new(), queues, goes_round: false }
    }

    fn may(&self, tenant: &Tenant) -> bool {
        self.free > 0 && !self.is_full_of(tenant)
    }

    /// Returns true if the tenant holds as many permits as one tenant may.
    pub fn is_full_of(&self, tenant: &Tenant) -> bool {
        self.running_of(tenant) >= self.of_one
    }

    fn take(&mut self, tenant: &Tenant) {
        self.free -= 1;
        *self.running.entry(tenant.clone()).or_default() += 1;
    }

    /// Takes a permit and returns `None` if there is one for the tenant; otherwise queues for one.
    pub fn ask(&mut self, tenant: &Tenant, rank: u128) -> Option<oneshot::Receiver<G>> {
        if self.may(tenant) {
            self.take(tenant);
            return None;
        }
        let (grant, granted) = oneshot::channel();
        let queue = self.queues.entry(tenant.clone()).or_default();
        if queue.is_empty() {
            self.ring.push_back(tenant.clone());
        }
        queue.push_back(WaitingPiece { rank, grant });
        Some(granted)
    }

    /// Takes a permit back and passes it on: alternately to the tenant whose turn it is, and to the piece of the lowest
    /// rank.
    pub fn give_back(&mut self, tenant: &Tenant) -> Option<(Tenant, oneshot::Sender<G>)> {
        self.free += 1;
        if let Some(running) = self.running.get_mut(tenant) {
            *running -= 1;
            if *running == 0 {
                self.running.remove(tenant);
            }
        }
        self.forget_gone();
        let mut next = self.ring.iter().filter(|tenant| self.may(tenant));
        let least = |tenant: &&Tenant| self.queues.get(*tenant).and_then(first).map(|(_, rank)| rank);
        let tenant = if self.goes_round { next.next() } else { next.min_by_key(least) }?.clone();
        let queue = self.queues.get_mut(&tenant)?;
        let (least, _) = first(queue)?;
        let WaitingPiece { grant, .. } = queue.remove(if self.goes_round { 0 } else { least })?;
        self.goes_round = !self.goes_round;
        // The tenant goes to the end of the ring.
        self.ring.retain(|waiting| *waiting != tenant);
        if queue.is_empty() {
            self.queues.remove(&tenant);
        } else {
            self.ring.push_back(tenant.clone());
        }
        self.take(&tenant);
        Some((tenant, grant))
    }

    /// Removes a piece from a full queue if one must make room for a new piece of `tenant` with this rank. Also returns
    /// how many pieces of the removed one's tenant still wait. Returns `None` if the new piece itself is the one to
    /// refuse.
    pub fn give_up_one(&mut self, tenant: &Tenant, rank: u128) -> Option<(oneshot::Sender<G>, usize)> {
        self.forget_gone();
        let worst = |(tenant, queue): (&Tenant, &VecDeque<WaitingPiece<G>>)| {
            let (at, rank) = queue.iter().map(|waiting| waiting.rank).enumerate().max_by_key(|&(_, rank)| rank)?;
            Some(((queue.len(), rank), at, tenant.clone()))
        };
        let ((count, most), at, loser) = self.queues.iter().filter_map(worst).max_by_key(|(key, ..)| *key)?;
        if (count, most) <= (self.waiting_of(tenant) + 1, rank) {
            return None;
        }
        let queue = self.queues.get_mut(&loser)?;
        let WaitingPiece { grant, .. } = queue.remove(at)?;
        self.forget_gone();
        Some((grant, count - 1))
    }

    /// Forgets the pieces that wait no more.
    fn forget_gone(&mut self) {
        self.queues.retain(|_, queue| {
            queue.retain(|waiting| !waiting.grant.is_closed());
            !queue.is_empty()
        });
        let StageQueue { ring, queues, .. } = self;
        ring.retain(|tenant| queues.contains_key(tenant));
    }

    /// Returns true if no more pieces may wait.
    pub fn is_full(&self) -> bool {
        self.waiting() >= self.most_waiting
    }

    pub fn running_of(&self, tenant: &Tenant) -> usize {
        self.running.get(tenant).copied().unwrap_or_default()
    }

    pub fn waiting(&self) -> usize {
        self.queues.keys().map(|tenant| self.waiting_of(tenant)).sum()
    }

    pub fn waiting_of(&self, tenant: &Tenant) -> usize {
        self.queues.get(tenant).map_or(0, |queue| queue.iter().filter(|waiting| !waiting.grant.is_closed()).count())
    }
}

/// Returns the position in a queue, and the rank, of its first piece of the lowest rank.
fn first<G>(queue: &VecDeque<WaitingPiece<G>>) -> Option<(usize, u128)> {
    queue.iter().map(|waiting| waiting.rank).enumerate().min_by_key(|&(_, rank)| rank)
}
