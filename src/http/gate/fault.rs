//! Translates errors of the lower layers into problem documents.

use std::error::Error;
use std::time::Duration;

use crate::http::gate::telemetry;
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::service::callers::allowance::{Refused, TooMany};
use crate::service::entries::doubts::Doubts;
use crate::service::error::ServiceError;
use crate::service::metrics as names;
use crate::store::{OverQuota, Quota, StoreError};

/// Wait before a tenant whose own work is in the way may call again.
const OWN_WORK: Duration = Duration::from_secs(1);

/// The rule of an idempotency key that was used.
const SAME_BODY: &str = "must come with the same body as the first time; send another body with a new key";
/// The rule of a session that is imported.
const ELSEWHERE: &str = "must name a session that this service does not have; delete it here first";

impl From<ServiceError> for ProblemDocument {
    fn from(error: ServiceError) -> Self {
        use ProblemKind as Kind;
        let detail = error.to_string();
        let problem = |kind| ProblemDocument::new(kind, detail);
        match error {
            ServiceError::Field(field) => ProblemDocument::of_field(Kind::InvalidField, field),
            ServiceError::Unknown { what, id } => {
                problem(Kind::NotFound).naming(what, id, format!("must name a {what}"))
            }
            ServiceError::KeyConflict { key } => {
                problem(Kind::IdempotencyConflict).naming("Idempotency-Key", key, SAME_BODY)
            }
            ServiceError::PolicyInUse { policy, .. } => {
                problem(Kind::InUse).naming("policy", policy, "must not be used by any session")
            }
            ServiceError::SessionExists { session } => problem(Kind::InUse).naming("session", session, ELSEWHERE),
            ServiceError::Refused(Refused::TooManyStreams { most }) => {
                problem(Kind::TooManyRequests).naming("streams", most, format!("must be at most {most} at a time"))
            }
            ServiceError::Conflict { what, number } => {
                let rule = "must have the same content as when it was first reported";
                problem(Kind::ReportConflict).naming(what, number, rule)
            }
            ServiceError::RenewedAlready { number, .. } => {
                let next = number + 1;
                let rule = format!("must be {next} for another renewal, because renewal {number} exists");
                problem(Kind::ReportConflict).naming("renewal", number, rule)
            }
            ServiceError::Gap { what, given, expected } => {
                problem(Kind::ReportGap).naming(what, given, format!("must be {expected}"))
            }
            ServiceError::Unconfirmed(Doubts(doubts)) => {
                let problem = problem(Kind::Unconfirmed);
                let Some(first) = doubts.first() else { return problem };
                let named = problem.naming(first.field.clone(), first.value.clone(), first.rule());
                ProblemDocument { doubts: Some(Box::new(Doubts(doubts))), ..named }
            }
            ServiceError::PastHorizon { given, horizon } => {
                problem(Kind::SessionCompleted).naming("period", given, format!("must be at most {horizon}"))
            }
            ServiceError::Completed { session, horizon } => {
                let rule = format!("must name a session with fewer than {horizon} periods observed");
                problem(Kind::SessionCompleted).naming("session", session, rule)
            }
            ServiceError::Draining | ServiceError::Busy | ServiceError::Refused(Refused::NoPlace) => {
                problem(Kind::Overloaded)
            }
            ServiceError::Refused(Refused::OwnWork) => {
                let rule = "must wait until other calls of the tenant have ended; send it again then";
                problem(Kind::TooManyRequests).naming("work", "this call", rule).to_be_asked_again_in(OWN_WORK)
            }
            ServiceError::Refused(Refused::TooOften(class, TooMany { per_second, wait })) => {
                let rule = format!("must be at most {per_second} calls a second, over all keys of the tenant");
                problem(Kind::TooManyRequests).naming("rate", class.name(), rule).to_be_asked_again_in(wait)
            }
            // These errors occur at the start, before there are any callers.
            error @ (ServiceError::NobodyAsked { .. } | ServiceError::KeysLost { .. } | ServiceError::KeysRequired) => {
                ProblemDocument::new(Kind::Internal, error.to_string())
            }
            ServiceError::JobNotEnded { job } => {
                problem(Kind::JobNotEnded).naming("job", job, "must name a job that has ended")
            }
            ServiceError::Store(StoreError::OverQuota(over)) => of_quota(over),
            ServiceError::Store(error) => of_store(&error),
            ServiceError::Internal(reason) => {
                tracing::error!(reason, "a request failed");
                ProblemDocument::new(Kind::Internal, "the cause is in the log")
            }
        }
    }
}

fn of_store(error: &StoreError) -> ProblemDocument {
    // A probe needs no key, and each failed probe would log a line.
    if telemetry::may_log() {
        tracing::error!(error = error as &dyn Error, "the store failed");
    }
    names::count_failure(error);
    let kind = match error {
        StoreError::Full { .. } => ProblemKind::StorageFull,
        StoreError::Unavailable { .. } => ProblemKind::Overloaded,
        _ => ProblemKind::Internal,
    };
    ProblemDocument::new(kind, error.to_string())
}

fn of_quota(over: OverQuota) -> ProblemDocument {
    let (kind, remedy) = match over.quota {
        Quota::QueuedJobs => (ProblemKind::QueueFull, "wait for queued jobs, or cancel some"),
        Quota::Sessions => (ProblemKind::QuotaExceeded, "delete sessions"),
        Quota::Bytes => (ProblemKind::QuotaExceeded, "delete ended jobs, sessions or policies"),
        Quota::AuditEntries => {
            (ProblemKind::QuotaExceeded, "use another key, or wait until older entries are past --audit-days")
        }
    };
    let option = over.quota.option();
    let of = if over.quota == Quota::AuditEntries { "for this key" } else { "over all keys of the tenant" };
    let rule = format!("must be at most {}, {of}: {remedy}, or raise --{option}", over.limit);
    ProblemDocument::new(kind, format!("{over}: {remedy}")).naming(option, over.kept + over.wanted, rule)
}
