//! The stages of work, and the queue of each: who gets a place that becomes free, and who loses one in a full queue.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use tokio::sync::oneshot;

use crate::store::Tenant;

/// How long a piece is in the first stage, which most pieces end in.
const FIRST: Duration = Duration::from_millis(100);
/// How long a piece has worked when it enters the third stage.
const SECOND: Duration = Duration::from_secs(1);
/// How long a piece keeps a place of the second stage while others wait.
const SECOND_TURN: Duration = Duration::from_millis(100);
/// How long a piece keeps a place of the third stage while others wait.
const LONG_TURN: Duration = Duration::from_millis(250);
/// How far a piece has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    First,
    Second,
    Long,
}

impl Stage {
    /// The stage of a piece that has worked for so long.
    pub fn after(worked: Duration) -> Stage {
        match worked {
            worked if worked < FIRST => Stage::First,
            worked if worked < SECOND => Stage::Second,
            _ => Stage::Long,
        }
    }

    pub fn turn(self) -> Duration {
        match self {
            Stage::First => FIRST,
            Stage::Second => SECOND_TURN,
            Stage::Long => LONG_TURN,
        }
    }

    /// Pieces of a lower rank come first; those of equal rank take turns.
    pub fn rank(self, worked: Duration) -> u128 {
        if self == Stage::Second { worked.as_millis() / SECOND_TURN.as_millis() } else { 0 }
    }
}

/// The places of one stage, and who waits for them.
pub(super) struct StageQueue<G> {
    /// Places that nobody has; while there are any, all who wait have as many as one tenant may.
    pub free: usize,
    /// Places that one tenant may have.
    pub of_one: usize,
    /// Pieces that may wait.
    pub most_waiting: usize,
    /// Places that each tenant has; none of them 0.
    pub running: HashMap<Tenant, usize>,
    /// Tenants that wait, whose turn is next first; each has a queue.
    pub ring: VecDeque<Tenant>,
    pub queues: HashMap<Tenant, VecDeque<WaitingPiece<G>>>,
}

/// A piece that waits for a place.
pub(super) struct WaitingPiece<G> {
    rank: u128,
    grant: oneshot::Sender<G>,
}

impl<G> StageQueue<G> {
    pub fn new(free: usize, of_one: usize, most_waiting: usize) -> Self {
        let (running, queues) = (HashMap::new(), HashMap::new());
        StageQueue { free, of_one, most_waiting, running, ring: VecDeque::new(), queues }
    }

    fn may(&self, tenant: &Tenant) -> bool {
        self.free > 0 && !self.is_full_of(tenant)
    }

    /// Whether the tenant has as many places as it may.
    pub fn is_full_of(&self, tenant: &Tenant) -> bool {
        self.running.get(tenant).copied().unwrap_or_default() >= self.of_one
    }

    fn take(&mut self, tenant: &Tenant) {
        self.free -= 1;
        *self.running.entry(tenant.clone()).or_default() += 1;
    }

    /// Takes a place if there is one for the tenant: `None`. Else waits for it.
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

    /// Takes a place back, and gives it to the piece of the lowest rank, of equal ones to that of the tenant whose turn is next.
    pub fn give_back(&mut self, tenant: &Tenant) -> Option<(Tenant, oneshot::Sender<G>)> {
        self.free += 1;
        if let Some(running) = self.running.get_mut(tenant) {
            *running -= 1;
            if *running == 0 {
                self.running.remove(tenant);
            }
        }
        self.forget_gone();
        let next = self.ring.iter().filter(|tenant| self.may(tenant));
        let tenant = next.min_by_key(|tenant| self.queues.get(*tenant).and_then(first).map(|(_, rank)| rank))?.clone();
        let queue = self.queues.get_mut(&tenant)?;
        let (at, _) = first(queue)?;
        let WaitingPiece { grant, .. } = queue.remove(at)?;
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

    /// Removes from a full queue the piece that should make room for one of `tenant`, if any should. Also returns whether its
    /// tenant has more pieces in the queue.
    pub fn give_up_one(&mut self, tenant: &Tenant, rank: u128) -> Option<(oneshot::Sender<G>, bool)> {
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
        Some((grant, count > 1))
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

    pub fn waiting(&self) -> usize {
        self.queues.keys().map(|tenant| self.waiting_of(tenant)).sum()
    }

    pub fn waiting_of(&self, tenant: &Tenant) -> usize {
        self.queues.get(tenant).map_or(0, |queue| queue.iter().filter(|waiting| !waiting.grant.is_closed()).count())
    }
}

/// The place in a queue, and the rank, of its first piece of the lowest rank.
fn first<G>(queue: &VecDeque<WaitingPiece<G>>) -> Option<(usize, u128)> {
    queue.iter().map(|waiting| waiting.rank).enumerate().min_by_key(|&(_, rank)| rank)
}
