//! Sessions that wait for the training of their next policies: grouped by job, or in line if the queue has no room for
//! their training.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};

use crate::service::sessions::Name;
use crate::store::Tenant;

/// Waiting sessions; each is there once.
#[derive(Default)]
pub(super) struct WaitingSessions {
    for_job: BTreeMap<String, Vec<Name>>,
    /// Lines by tenant; none is empty.
    in_line: HashMap<Tenant, VecDeque<Name>>,
    known: HashSet<Name>,
    counts: HashMap<Tenant, usize>,
}

impl WaitingSessions {
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    pub fn contains(&self, name: &Name) -> bool {
        self.known.contains(name)
    }

    /// Returns how many sessions of a tenant wait.
    pub fn count(&self, tenant: &Tenant) -> usize {
        self.counts.get(tenant).copied().unwrap_or_default()
    }

    /// Returns the jobs that sessions wait for.
    pub fn jobs(&self) -> Vec<String> {
        self.for_job.keys().cloned().collect()
    }

    pub fn for_job(&mut self, job: String, name: Name) {
        if self.enter(&name) {
            self.for_job.entry(job).or_default().push(name);
        }
    }

    pub fn for_room(&mut self, name: Name) {
        if self.enter(&name) {
            self.in_line.entry(name.0.clone()).or_default().push_back(name);
        }
    }

    /// Removes and returns the sessions that waited for a job.
    pub fn ended(&mut self, job: &str) -> Vec<Name> {
        let names = self.for_job.remove(job).unwrap_or_default();
        names.iter().for_each(|name| self.leave(name));
        names
    }

    /// Removes and returns the first session in a tenant's line.
    pub fn next_in_line(&mut self, tenant: &Tenant) -> Option<Name> {
        let line = self.in_line.get_mut(tenant)?;
        let name = line.pop_front()?;
        if line.is_empty() {
            self.in_line.remove(tenant);
        }
        self.leave(&name);
        Some(name)
    }

    /// Removes and returns the first session of every line.
    pub fn first_in_line(&mut self) -> Vec<Name> {
        let tenants: Vec<Tenant> = self.in_line.keys().cloned().collect();
        tenants.iter().filter_map(|tenant| self.next_in_line(tenant)).collect()
    }

    fn enter(&mut self, name: &Name) -> bool {
        let is_new = self.known.insert(name.clone());
        if is_new {
            *self.counts.entry(name.0.clone()).or_default() += 1;
        }
        is_new
    }

    fn leave(&mut self, name: &Name) {
        self.known.remove(name);
        if let Some(count) = self.counts.get_mut(&name.0) {
            *count -= 1;
            if *count == 0 {
                self.counts.remove(&name.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(tenant: &str, session: usize) -> Name {
        (tenant.parse().unwrap(), format!("session_{session}"))
    }

    #[test]
    fn sessions_wait_once_for_their_job_or_in_line() {
        let (north, south) = ("north".parse().unwrap(), "south".parse().unwrap());
        let mut waiting = WaitingSessions::default();
        (0..3).for_each(|session| waiting.for_job("job".into(), name("north", session)));
        waiting.for_job("job".into(), name("north", 1));
        (3..5).for_each(|session| waiting.for_room(name("north", session)));
        waiting.for_room(name("south", 0));
        assert_eq!((waiting.count(&north), waiting.count(&south)), (5, 1));
        assert!(waiting.contains(&name("north", 4)) && !waiting.contains(&name("north", 5)));
        assert_eq!(waiting.jobs(), ["job"]);
        assert_eq!(waiting.ended("job"), [0, 1, 2].map(|session| name("north", session)));
        assert_eq!((waiting.ended("job"), waiting.count(&north)), (Vec::new(), 2));
        assert_eq!(waiting.next_in_line(&north), Some(name("north", 3)));
        let mut first = waiting.first_in_line();
        first.sort();
        assert_eq!(first, [name("north", 4), name("south", 0)]);
        assert!(waiting.is_empty() && waiting.next_in_line(&north).is_none());
    }
}
