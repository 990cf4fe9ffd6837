//! Which session is looked at next: of a tenant one at a time, and tenants side by side, so that nobody waits for the sessions
//! of another.

use std::collections::{HashMap, HashSet, VecDeque};

use crate::service::sessions::Name;
use crate::store::Tenant;

/// Tenants looked at side by side; of more, each waits for one session of another at most.
const AT_ONCE: usize = 64;

/// Sessions that wait to be looked at, and those that are.
#[derive(Default)]
pub(super) struct Turns {
    /// By tenant; no queue is empty.
    waiting: HashMap<Tenant, VecDeque<Name>>,
    /// Tenants with a queue of whom no session is looked at, whose turn is next first.
    ring: VecDeque<Tenant>,
    looked_at: HashMap<Tenant, Name>,
    known: HashSet<Name>,
}

impl Turns {
    /// Queues a session, unless it waits already or is looked at.
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

    /// The session to look at next, until [`Self::done`]; `None` where none waits that may be.
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

    /// The session was looked at.
    pub fn done(&mut self, name: &Name) {
        self.known.remove(name);
        self.looked_at.remove(&name.0);
        if self.waiting.contains_key(&name.0) {
            self.ring.push_back(name.0.clone());
        }
    }

    /// Whether no session waits or is looked at.
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Sessions of a tenant that wait.
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
        let mut turns = Turns::default();
        (0..200).for_each(|session| turns.queue(name("north", session)));
        turns.queue(name("south", 0));
        assert_eq!([turns.next(), turns.next(), turns.next()], [Some(name("north", 0)), Some(name("south", 0)), None]);
        // What is looked at and what waits is known.
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
        let mut turns = Turns::default();
        (0..AT_ONCE + 1).for_each(|tenant| turns.queue(name(&format!("tenant{tenant}"), 0)));
        let begun: Vec<Name> = std::iter::from_fn(|| turns.next()).collect();
        assert_eq!(begun.len(), AT_ONCE);
        turns.done(&begun[5]);
        assert_eq!(turns.next(), Some(name(&format!("tenant{AT_ONCE}"), 0)));
    }
}
