//! Chooses the next session to handle: one at a time for each tenant, and tenants concurrently, so that no tenant waits
//! for the sessions of another.

use std::collections::{HashMap, HashSet, VecDeque};

use crate::service::sessions::Name;
use crate::store::Tenant;

/// Tenants handled concurrently; beyond that, each waits for at most one session of another.
const AT_ONCE: usize = 64;

/// Sessions that wait to be handled, and those being handled.
#[derive(Default)]
pub(super) struct RenewalTurns {
    /// Queues by tenant; none is empty.
    waiting: HashMap<Tenant, VecDeque<Name>>,
    /// Tenants with a queue and no session being handled, the next one first.
    ring: VecDeque<Tenant>,
    looked_at: HashMap<Tenant, Name>,
    known: HashSet<Name>,
}

impl RenewalTurns {
    /// Queues a session, unless it waits already or is being handled.
    pub fn queue(&mut self, name: Name) {
        if !self.known.insert(name.clone()) {
            return;
        }
        let tenant = name.0.clone();
        let queue = self.waiting.entry(tenant.clone()).or_default();
        queue.push_back(name);
        if queue.len() == 1 && !self.looked_at.contains_key(&tenant) {
            self.ring.push_back(tenant);
        }
    }

    /// Returns the session to handle next, until [`Self::done`]; `None` if no session may be handled now.
    pub fn next(&mut self) -> Option<Name> {
        if self.looked_at.len() >= AT_ONCE {
            return None;
        }
        let tenant = self.ring.pop_front()?;
        let queue = self.waiting.get_mut(&tenant)?;
        let name = queue.pop_front()?;
        if queue.is_empty() {
            self.waiting.remove(&tenant);
        }
        self.looked_at.insert(tenant, name.clone());
        Some(name)
    }

    /// Marks the session as handled.
    pub fn done(&mut self, name: &Name) {
        self.known.remove(name);
        self.looked_at.remove(&name.0);
        if self.waiting.contains_key(&name.0) {
            self.ring.push_back(name.0.clone());
        }
    }

    /// Returns whether no session waits or is being handled.
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Returns how many sessions of a tenant wait.
    pub fn waiting(&self, tenant: &Tenant) -> usize {
        self.waiting.get(tenant).map_or(0, VecDeque::len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(tenant: &str, session: usize) -> Name {
        (tenant.parse().unwrap(), format!("session_{session}"))
    }

    #[test]
    fn a_tenant_of_many_sessions_is_in_nobodys_way() {
        let mut turns = RenewalTurns::default();
        (0..200).for_each(|session| turns.queue(name("north", session)));
        turns.queue(name("south", 0));
        assert_eq!([turns.next(), turns.next(), turns.next()], [Some(name("north", 0)), Some(name("south", 0)), None]);
        // Sessions that wait or are being handled are not queued again.
        turns.queue(name("north", 0));
        turns.queue(name("north", 7));
        assert_eq!(turns.waiting(&"north".parse().unwrap()), 199);
        turns.queue(name("south", 1));
        turns.done(&name("south", 0));
        assert_eq!([turns.next(), turns.next()], [Some(name("south", 1)), None]);
        turns.done(&name("north", 0));
        assert_eq!(turns.next(), Some(name("north", 1)));
        turns.done(&name("north", 1));
        turns.queue(name("north", 0));
        let rest: Vec<Name> = std::iter::from_fn(|| {
            let next = turns.next()?;
            turns.done(&next);
            Some(next)
        })
        .collect();
        assert_eq!((rest.len(), rest.last()), (199, Some(&name("north", 0))));
    }

    #[test]
    fn so_many_tenants_are_looked_at_side_by_side() {
        let mut turns = RenewalTurns::default();
        (0..AT_ONCE + 1).for_each(|tenant| turns.queue(name(&format!("tenant{tenant}"), 0)));
        let begun: Vec<Name> = std::iter::from_fn(|| turns.next()).collect();
        assert_eq!(begun.len(), AT_ONCE);
        turns.done(&begun[5]);
        assert_eq!(turns.next(), Some(name(&format!("tenant{AT_ONCE}"), 0)));
    }
}
