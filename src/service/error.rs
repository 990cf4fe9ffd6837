//! The errors of the use cases.

use std::net::SocketAddr;
use std::path::PathBuf;

use thiserror::Error;

use crate::control::error::FieldError;
use crate::service::callers::allowance::Refused;
use crate::service::entries::doubts::Doubts;
use crate::store::StoreError;

#[derive(Debug, Error)]
pub enum ServiceError {
    #[error(transparent)]
    Field(#[from] FieldError),
    #[error("there is no {what} '{id}'")]
    Unknown { what: &'static str, id: String },
    #[error("the idempotency key '{key}' was used with another body")]
    KeyConflict { key: String },
    #[error("{sessions} sessions use the policy '{policy}'; delete them first")]
    PolicyInUse { policy: String, sessions: u64 },
    #[error("the session '{session}' exists already")]
    SessionExists { session: String },
    #[error("the job '{job}' has not ended; cancel it first")]
    JobNotEnded { job: String },
    #[error("{what} {number} was reported with other content")]
    Conflict { what: &'static str, number: usize },
    #[error("renewal {number} was made by {by} at {at}, with other content: read the session again")]
    RenewedAlready { number: usize, by: String, at: String },
    #[error("{what} {given} is not the one expected: report {what} {expected}")]
    Gap { what: &'static str, given: usize, expected: usize },
    #[error("{0}")]
    Unconfirmed(Doubts),
    #[error("period {given} lies past the horizon of {horizon} periods")]
    PastHorizon { given: usize, horizon: usize },
    #[error("the session '{session}' has observed all {horizon} periods of its horizon")]
    Completed { session: String, horizon: usize },
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(
        "other machines can reach {address}, but the store holds no key: make one with `ballast keys create`, listen on loopback, or pass --allow-anonymous"
    )]
    NobodyAsked { address: SocketAddr },
    #[error(
        "{} says that the store had keys, but it holds none now: restore its database, make a key with `ballast keys create`, or remove that file to answer without keys", mark.display()
    )]
    KeysLost { mark: PathBuf },
    #[error(
        "--require-keys is given, but the store holds no key: make one with `ballast keys create`, or give the store that has the keys"
    )]
    KeysRequired,
    #[error("the service is shutting down")]
    Draining,
    #[error("too many requests of this kind are already waiting")]
    Busy,
    #[error(transparent)]
    Refused(#[from] Refused),
    #[error("{0}")]
    Internal(String),
}

impl ServiceError {
    pub(super) fn unknown(what: &'static str, id: &str) -> Self {
        ServiceError::Unknown { what, id: id.to_owned() }
    }

    /// Wraps an error in a recorded period that no longer keeps a rule.
    pub(super) fn of_recorded((period, error): (usize, FieldError)) -> Self {
        ServiceError::Internal(format!("period {period}: {error}"))
    }

    pub fn internal(error: impl std::fmt::Display) -> Self {
        ServiceError::Internal(error.to_string())
    }
}
