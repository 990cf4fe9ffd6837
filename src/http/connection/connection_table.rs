//! The table of connections, in which an idle connection never keeps an active client out.
//!
//! An idle connection does not show if its client is honest. So a full table does not reject new clients: the
//! connection that has waited longest for its client is closed. It is one of the client's own address if that address
//! has its share, and otherwise one of the address with most connections.
//! Connections are closed in this order: those between two requests, those whose request body is still to come, and
//! event streams, which clients can resume. A connection that works on a call is never closed; such calls are bounded
//! by the tenants' limits and by the request timeout. If even they fill the table, a few reserved connections beyond it
//! serve the probes only.
//!
//! An address is an IPv4 address, or the first 64 bits of an IPv6 address: what one subscriber has.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

/// Limits on the number of connections.
#[derive(Debug, Clone, Copy)]
pub struct ConnectionLimits {
    pub all: usize,
    /// Most connections of one address.
    pub of_address: usize,
    /// Connections beyond `all`, for the probes.
    pub for_probes: usize,
}

/// The activity of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConnectionPhase {
    /// Waits for a request, or for the client to take the end of an answer.
    Waiting,
    /// Has a request whose body has not fully arrived.
    Receiving,
    /// Sends events.
    Streaming,
    /// Has a request that is being answered.
    Working,
    /// Closed to make room: nothing more is answered.
    Closed,
}

impl ConnectionPhase {
    /// All phases, in the order in which they are closed to make room; the last two never are.
    pub const ALL: [ConnectionPhase; 5] = [
        ConnectionPhase::Waiting,
        ConnectionPhase::Receiving,
        ConnectionPhase::Streaming,
        ConnectionPhase::Working,
        ConnectionPhase::Closed,
    ];

    pub fn name(self) -> &'static str {
        match self {
            ConnectionPhase::Waiting => "waiting",
            ConnectionPhase::Receiving => "receiving",
            ConnectionPhase::Streaming => "streaming",
            ConnectionPhase::Working => "working",
            ConnectionPhase::Closed => "closed",
        }
    }

    fn gives_way(self) -> bool {
        matches!(self, ConnectionPhase::Waiting | ConnectionPhase::Receiving | ConnectionPhase::Streaming)
    }
}

/// The requests that a connection may make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AllowedRequests {
    Any,
    /// One request to a probe.
    Probes,
}

/// One connection. Its phase and the time of its last change are packed in one number, so that closing it to make room
/// and beginning a request on it cannot both succeed.
#[derive(Debug)]
pub struct TrackedConnection {
    pub place: AllowedRequests,
    number: u64,
    opened: Instant,
    /// Milliseconds since `opened`, shifted by [`PHASE_BITS`], and the phase.
    state: AtomicU64,
    requests: AtomicU64,
    left: AtomicBool,
    gave_way: Notify,
}

const PHASE_BITS: u32 = 3;

impl TrackedConnection {
    fn new(number: u64, place: AllowedRequests) -> Arc<Self> {
        let (state, requests) = (AtomicU64::new(ConnectionPhase::Waiting as u64), AtomicU64::new(0));
        Arc::new(TrackedConnection {
            place,
            number,
            opened: Instant::now(),
            state,
            requests,
            left: AtomicBool::new(false),
            gave_way: Notify::new(),
        })
    }

    fn packed(&self, phase: ConnectionPhase) -> u64 {
        let milliseconds = u64::try_from(self.opened.elapsed().as_millis()).unwrap_or(u64::MAX >> PHASE_BITS);
        milliseconds << PHASE_BITS | phase as u64
    }

    fn unpacked(&self) -> (u64, ConnectionPhase, Instant) {
        let state = self.state.load(Ordering::Acquire);
        let phase = ConnectionPhase::ALL[(state & ((1 << PHASE_BITS) - 1)) as usize];
        (state, phase, self.opened + Duration::from_millis(state >> PHASE_BITS))
    }

    pub fn phase(&self) -> ConnectionPhase {
        self.unpacked().1
    }

    /// Returns when the phase began, or when the client last read part of an answer.
    pub fn since(&self) -> Instant {
        self.unpacked().2
    }

    pub fn age(&self) -> Duration {
        self.opened.elapsed()
    }

    /// Returns the number of requests begun.
    pub fn requests(&self) -> u64 {
        self.requests.load(Ordering::Relaxed)
    }

    /// Begins a request, in the phase `to`; returns true if the connection is still open.
    #[must_use]
    pub fn begin(&self, to: ConnectionPhase) -> bool {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.change(|phase| (phase != ConnectionPhase::Closed).then_some(to))
    }

    /// Records that the body of the request is complete.
    pub fn received(&self) {
        self.change(|phase| (phase == ConnectionPhase::Receiving).then_some(ConnectionPhase::Working));
    }

    /// Records that the answer is a stream of events.
    pub fn stream(&self) {
        self.change(|phase| (phase != ConnectionPhase::Closed).then_some(ConnectionPhase::Streaming));
    }

    /// Records that the answer was sent.
    pub fn rest(&self) {
        self.change(|phase| (phase != ConnectionPhase::Closed).then_some(ConnectionPhase::Waiting));
    }

    /// Records that the answer came before the request was fully read.
    pub fn leave(&self) {
        self.left.store(true, Ordering::Relaxed);
    }

    pub fn has_left(&self) -> bool {
        self.left.load(Ordering::Relaxed)
    }

    /// Records that the client read something.
    pub fn note_read(&self) {
        self.change(|phase| (phase == ConnectionPhase::Waiting).then_some(ConnectionPhase::Waiting));
    }

    fn change(&self, next: impl Fn(ConnectionPhase) -> Option<ConnectionPhase>) -> bool {
        loop {
            let (state, phase, _) = self.unpacked();
            let Some(next) = next(phase) else { return false };
            let replaced =
                self.state.compare_exchange_weak(state, self.packed(next), Ordering::AcqRel, Ordering::Acquire);
            if replaced.is_ok() {
                return true;
            }
        }
    }

    /// Closes the connection to make room, unless its state has changed since `looked_at`.
    fn give_way(&self, looked_at: u64) -> bool {
        let closed = self.packed(ConnectionPhase::Closed);
        let gives = self.state.compare_exchange(looked_at, closed, Ordering::AcqRel, Ordering::Acquire).is_ok();
        if gives {
            self.gave_way.notify_one();
        }
        gives
    }

    /// Resolves once the connection must close to make room.
    pub async fn gave_way(&self) {
        self.gave_way.notified().await;
    }
}

/// All connections of a listener.
pub struct Connections {
    bounds: ConnectionLimits,
    table: Mutex<ConnectionTable>,
}

#[derive(Default)]
struct ConnectionTable {
    next: u64,
    count: usize,
    by_address: HashMap<IpAddr, Vec<Arc<TrackedConnection>>>,
    probing: Vec<Arc<TrackedConnection>>,
}

/// A connection's slot in the table, released when dropped.
pub struct ConnectionGuard {
    pub connection: Arc<TrackedConnection>,
    address: IpAddr,
    connections: Arc<Connections>,
}

impl Drop for ConnectionGuard {
    fn drop(&mut self) {
        self.connections.lock().remove(self.address, &self.connection);
    }
}

impl Connections {
    pub fn new(bounds: ConnectionLimits) -> Arc<Self> {
        Arc::new(Connections { bounds, table: Mutex::default() })
    }

    /// Adds a connection from `address`; `None` if every slot is busy with a call, including those for probes.
    pub fn place(self: &Arc<Self>, address: IpAddr) -> Option<ConnectionGuard> {
        let address = subscriber(address);
        let connection = self.lock().placed(address, &self.bounds)?;
        Some(ConnectionGuard { connection, address, connections: self.clone() })
    }

    /// Counts the connections in each phase.
    pub fn count(&self) -> [(ConnectionPhase, usize); 5] {
        let table = self.lock();
        let all = || table.by_address.values().flatten().chain(&table.probing);
        ConnectionPhase::ALL.map(|phase| (phase, all().filter(|connection| connection.phase() == phase).count()))
    }

    fn lock(&self) -> MutexGuard<'_, ConnectionTable> {
        // No code panics while holding the lock.
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ConnectionTable {
    fn placed(&mut self, address: IpAddr, bounds: &ConnectionLimits) -> Option<Arc<TrackedConnection>> {
        let own = self.by_address.get(&address).map_or(0, Vec::len);
        let has_room =
            (own < bounds.of_address || self.make_room_at(address)) && (self.count < bounds.all || self.make_room());
        self.next += 1;
        if has_room {
            let connection = TrackedConnection::new(self.next, AllowedRequests::Any);
            self.by_address.entry(address).or_default().push(connection.clone());
            self.count += 1;
            return Some(connection);
        }
        if self.probing.len() >= bounds.for_probes {
            let oldest = longest_waiting(self.probing.iter())?;
            self.probing.retain(|other| other.number != oldest.number);
        }
        let connection = TrackedConnection::new(self.next, AllowedRequests::Probes);
        self.probing.push(connection.clone());
        Some(connection)
    }

    /// Closes one connection of the address.
    fn make_room_at(&mut self, address: IpAddr) -> bool {
        let gave = self.by_address.get(&address).and_then(|own| longest_waiting(own.iter()));
        gave.is_some_and(|gave| self.remove(address, &gave))
    }

    /// Closes one connection: of the address with most, and otherwise of any address.
    fn make_room(&mut self) -> bool {
        let largest = self.by_address.iter().max_by_key(|(_, own)| own.len()).map(|(address, _)| *address);
        if largest.is_some_and(|address| self.make_room_at(address)) {
            return true;
        }
        let addresses: Vec<IpAddr> = self.by_address.keys().copied().collect();
        addresses.into_iter().any(|address| self.make_room_at(address))
    }

    fn remove(&mut self, address: IpAddr, connection: &TrackedConnection) -> bool {
        if connection.place == AllowedRequests::Probes {
            self.probing.retain(|other| other.number != connection.number);
            return true;
        }
        let Some(own) = self.by_address.get_mut(&address) else { return false };
        let Some(at) = own.iter().position(|other| other.number == connection.number) else { return false };
        own.swap_remove(at);
        if own.is_empty() {
            self.by_address.remove(&address);
        }
        self.count -= 1;
        true
    }
}

/// Closes one of the connections and returns it: the first in the order of phases, then of time.
fn longest_waiting<'a>(
    among: impl Iterator<Item = &'a Arc<TrackedConnection>> + Clone,
) -> Option<Arc<TrackedConnection>> {
    // The chosen connection may begin a request at the same moment; then another is chosen.
    const TRIES: usize = 8;
    (0..TRIES).find_map(|_| {
        let seen = among.clone().map(|connection| (connection, connection.unpacked()));
        let able = seen.filter(|(_, (_, phase, _))| phase.gives_way());
        let (connection, (state, ..)) = able.min_by_key(|(_, (_, phase, since))| (*phase as u8, *since))?;
        connection.give_way(state).then(|| connection.clone())
    })
}

fn subscriber(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() & !u128::from(u64::MAX)).into(),
        address => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(last: u8) -> IpAddr {
        [10, 0, 0, last].into()
    }

    fn table(all: usize, of_address: usize, for_probes: usize) -> Arc<Connections> {
        Connections::new(ConnectionLimits { all, of_address, for_probes })
    }

    fn later() {
        std::thread::sleep(Duration::from_millis(2));
    }

    #[test]
    fn the_longest_waiting_of_the_same_address_gives_way() {
        let table = table(10, 2, 0);
        let stranger = table.place(address(9)).unwrap();
        later();
        let first = table.place(address(1)).unwrap();
        later();
        let second = table.place(address(1)).unwrap();
        later();
        // The first was used again, so now the second has waited longest.
        assert!(first.connection.begin(ConnectionPhase::Working));
        first.connection.rest();
        let third = table.place(address(1)).unwrap();
        let phases = [&stranger, &first, &second, &third].map(|held| held.connection.phase());
        assert_eq!(
            phases,
            [ConnectionPhase::Waiting, ConnectionPhase::Waiting, ConnectionPhase::Closed, ConnectionPhase::Waiting]
        );
        assert!(!second.connection.begin(ConnectionPhase::Working), "a closed connection answers nothing more");
    }

    #[test]
    fn a_full_table_takes_from_the_address_with_most() {
        let table = table(4, 4, 0);
        let rare = table.place(address(1)).unwrap();
        later();
        let crowd: Vec<ConnectionGuard> = (0..3).map(|_| table.place(address(2)).unwrap()).collect();
        let _new = table.place(address(3)).unwrap();
        assert_eq!(rare.connection.phase(), ConnectionPhase::Waiting);
        assert_eq!(crowd.iter().filter(|held| held.connection.phase() == ConnectionPhase::Closed).count(), 1);
        drop(crowd);
        assert_eq!(table.lock().count, 2, "each slot is released once");
    }

    #[test]
    fn bodies_to_come_give_way_before_streams_and_work_never_does() {
        let table = table(3, 3, 1);
        let held: Vec<ConnectionGuard> = (0..3).map(|_| table.place(address(1)).unwrap()).collect();
        assert!(held[0].connection.begin(ConnectionPhase::Working));
        held[0].connection.stream();
        assert!(held[1].connection.begin(ConnectionPhase::Receiving));
        assert!(held[2].connection.begin(ConnectionPhase::Working));
        let fourth = table.place(address(1)).unwrap();
        assert!(fourth.connection.begin(ConnectionPhase::Working));
        let fifth = table.place(address(1)).unwrap();
        assert!(fifth.connection.begin(ConnectionPhase::Working));
        let phases: Vec<ConnectionPhase> = held.iter().map(|held| held.connection.phase()).collect();
        assert_eq!(phases, [ConnectionPhase::Closed, ConnectionPhase::Closed, ConnectionPhase::Working]);
        let probe = table.place(address(1)).unwrap();
        assert_eq!((fifth.connection.place, probe.connection.place), (AllowedRequests::Any, AllowedRequests::Probes));
        let next = table.place(address(1)).unwrap();
        assert_eq!(
            (probe.connection.phase(), next.connection.place),
            (ConnectionPhase::Closed, AllowedRequests::Probes)
        );
        assert!(next.connection.begin(ConnectionPhase::Working));
        assert!(table.place(address(1)).is_none(), "every connection is working on a request");
    }

    #[test]
    fn an_address_is_what_a_subscriber_has() {
        let of = |text: &str| subscriber(text.parse().unwrap());
        assert_eq!(of("2001:db8:1:2:3::4"), of("2001:db8:1:2:ffff::"));
        assert_ne!(of("2001:db8:1:2::"), of("2001:db8:1:3::"));
        assert_eq!(of("::ffff:10.0.0.1"), of("10.0.0.1"));
        assert_ne!(of("10.0.0.1"), of("10.0.0.2"));
    }
}
