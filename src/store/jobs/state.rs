//! The life of a job as a pure function; SQL stores the resulting state.
//!
//! ```text
//!            Claim            Succeed, Fail, Cancel
//!   Queued --------> Running ----------------------> Succeeded, Failed, Cancelled
//!     |  <---------    | ^
//!     |    Release     +-+ Claim (lease ran out), RequestCancel (flag only)
//!     +--- RequestCancel ---> Cancelled
//! ```

use serde::{Deserialize, Serialize};
use thiserror::Error;
use utoipa::ToSchema;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    Queued,
    Running,
    Succeeded,
    Failed,
    Cancelled,
}

/// An event in the life of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobEvent {
    /// A worker takes it, or takes it over from a worker whose lease ran out.
    Claim,
    /// Its worker gives it back unfinished.
    Release,
    /// A user asks for it to stop.
    RequestCancel,
    /// Its worker stopped it on request.
    Cancel,
    Succeed,
    Fail,
}

/// An event that cannot happen to a job in this state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("a {} job cannot {event:?}", from.as_str())]
pub struct IllegalTransition {
    pub from: JobState,
    pub event: JobEvent,
}

impl JobState {
    pub const ALL: [JobState; 5] =
        [JobState::Queued, JobState::Running, JobState::Succeeded, JobState::Failed, JobState::Cancelled];

    /// Returns the state after `event`.
    ///
    /// # Errors
    /// Fails for every event on a terminal state, and for every pair that the diagram above lacks.
    pub fn next(self, event: JobEvent) -> Result<JobState, IllegalTransition> {
        use JobState::{Cancelled, Failed, Queued, Running, Succeeded};
        match (self, event) {
            (Queued | Running, JobEvent::Claim) => Ok(Running),
            (Queued, JobEvent::RequestCancel) => Ok(Cancelled),
            (Running, JobEvent::RequestCancel) => Ok(Running),
            (Running, JobEvent::Release) => Ok(Queued),
            (Running, JobEvent::Cancel) => Ok(Cancelled),
            (Running, JobEvent::Succeed) => Ok(Succeeded),
            (Running, JobEvent::Fail) => Ok(Failed),
            (from, event) => Err(IllegalTransition { from, event }),
        }
    }

    /// Returns true if no event can change the state any more.
    pub fn is_terminal(self) -> bool {
        matches!(self, JobState::Succeeded | JobState::Failed | JobState::Cancelled)
    }

    /// Returns the name on the wire and in SQL.
    pub fn as_str(self) -> &'static str {
        match self {
            JobState::Queued => "queued",
            JobState::Running => "running",
            JobState::Succeeded => "succeeded",
            JobState::Failed => "failed",
            JobState::Cancelled => "cancelled",
        }
    }

    pub(in crate::store) fn parse(name: &str) -> Option<JobState> {
        JobState::ALL.into_iter().find(|state| state.as_str() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVENTS: [JobEvent; 6] = [
        JobEvent::Claim,
        JobEvent::Release,
        JobEvent::RequestCancel,
        JobEvent::Cancel,
        JobEvent::Succeed,
        JobEvent::Fail,
    ];

    #[test]
    fn terminal_states_never_change() {
        for state in JobState::ALL.into_iter().filter(|state| state.is_terminal()) {
            for event in EVENTS {
                assert_eq!(state.next(event), Err(IllegalTransition { from: state, event }));
            }
        }
    }

    #[test]
    fn a_queued_job_ends_only_by_a_cancel_request() {
        let ends: Vec<_> =
            EVENTS.into_iter().filter(|&event| JobState::Queued.next(event).is_ok_and(JobState::is_terminal)).collect();
        assert_eq!(ends, [JobEvent::RequestCancel]);
    }

    #[test]
    fn every_event_can_happen_to_a_running_job() {
        let next: Vec<_> = EVENTS.into_iter().filter_map(|event| JobState::Running.next(event).ok()).collect();
        use JobState::{Cancelled, Failed, Queued, Running, Succeeded};
        assert_eq!(next, [Running, Queued, Running, Cancelled, Succeeded, Failed]);
    }

    #[test]
    fn names_parse_back() {
        for state in JobState::ALL {
            assert_eq!(JobState::parse(state.as_str()), Some(state));
        }
        assert_eq!(JobState::parse("paused"), None);
    }
}
