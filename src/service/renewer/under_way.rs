//! The sessions that are being renewed: those to look at, and those that wait for a training.

use super::turns::Turns;
use super::waiting::Waiting;
use crate::service::sessions::Name;

/// Sessions of one tenant that are renewed at a time in this process: a bound of memory, half a megabyte. Those beyond it
/// follow.
const OF_ONE: usize = 4096;

/// What is left to do for a session.
pub(super) enum Left {
    Nothing,
    /// Once the job has ended.
    Job(String),
    /// Once the queue has room for its training.
    Room,
}

/// The sessions under way.
#[derive(Default)]
pub(super) struct UnderWay {
    pub turns: Turns,
    pub waiting: Waiting,
    /// The session before the first that a round left out, as many of its tenant being under way as may be.
    pub left_after: Option<i64>,
}

impl UnderWay {
    /// Begins with a session; false if as many of its tenant are under way as may be.
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

    /// A session's step is done. One that needed no room in the queue may leave some to the next in line.
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

    /// The sessions that waited for a job, which has ended: the queue has room for the next in line.
    pub fn ended(&mut self, job: &str) -> Vec<Name> {
        let names = self.waiting.ended(job);
        let next = names.first().and_then(|(tenant, _)| self.waiting.next_in_line(tenant));
        if let Some(name) = next {
            self.turns.queue(name);
        }
        names
    }

    /// Looks again whether the queue has room, for each tenant.
    pub fn retry(&mut self) {
        for name in self.waiting.first_in_line() {
            self.turns.queue(name);
        }
    }
}
