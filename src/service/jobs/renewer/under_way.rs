//! The sessions being renewed: those to handle, and those that wait for a training.

use super::turns::RenewalTurns;
use super::waiting::WaitingSessions;
use crate::service::sessions::Name;

/// Sessions of one tenant renewed concurrently in this process: a bound on memory, half a megabyte. Further ones follow
/// later.
const OF_ONE: usize = 4096;

/// The work left for a session.
pub(super) enum Left {
    Nothing,
    /// Continues once the job has ended.
    Job(String),
    /// Continues once the queue has room for its training.
    Room,
}

/// The sessions in progress.
#[derive(Default)]
pub(super) struct UnderWay {
    pub turns: RenewalTurns,
    pub waiting: WaitingSessions,
    /// Sequence of the session before the first that a round left out because its tenant has as many in progress as it
    /// may.
    pub left_after: Option<i64>,
}

impl UnderWay {
    /// Begins with a session; returns false if its tenant has as many in progress as it may.
    pub fn begin(&mut self, name: Name) -> bool {
        if self.waiting.contains(&name) {
            return true;
        }
        if self.turns.waiting(&name.0) + self.waiting.count(&name.0) >= OF_ONE {
            return false;
        }
        self.turns.queue(name);
        true
    }

    /// Records that a session's step is done. If it needed no room in the queue, the next in line is tried.
    pub fn stepped(&mut self, name: Name, left: Left) {
        self.turns.done(&name);
        let next = match left {
            Left::Room => {
                self.waiting.for_room(name);
                None
            }
            Left::Job(job) => {
                let next = self.waiting.next_in_line(&name.0);
                self.waiting.for_job(job, name);
                next
            }
            Left::Nothing => self.waiting.next_in_line(&name.0),
        };
        if let Some(name) = next {
            self.turns.queue(name);
        }
    }

    /// Returns the sessions that waited for an ended job. The queue now has room for the next in line.
    pub fn ended(&mut self, job: &str) -> Vec<Name> {
        let names = self.waiting.ended(job);
        let next = names.first().and_then(|(tenant, _)| self.waiting.next_in_line(tenant));
        if let Some(name) = next {
            self.turns.queue(name);
        }
        names
    }

    /// Tries again whether the queue has room, for each tenant.
    pub fn retry(&mut self) {
        for name in self.waiting.first_in_line() {
            self.turns.queue(name);
        }
    }
}
