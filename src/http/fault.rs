//! From what failed below to a problem document.

use std::error::Error;

use super::problem::{Problem, ProblemKind};
use crate::service::error::ServiceError;
use crate::store::StoreError;

impl From<ServiceError> for Problem {
    fn from(error: ServiceError) -> Self {
        let detail = error.to_string();
        let kind = match error {
            ServiceError::Field(field) => return Problem::of_field(ProblemKind::InvalidField, field),
            ServiceError::PeriodGap { given, expected } => {
                let rule = format!("must be {expected}");
                return Problem {
                    field: Some("period".into()),
                    value: Some(Box::new(given.into())),
                    rule: Some(rule.into()),
                    ..Problem::new(ProblemKind::PeriodGap, detail)
                };
            }
            ServiceError::Unknown { .. } => ProblemKind::NotFound,
            ServiceError::KeyConflict { .. } => ProblemKind::IdempotencyConflict,
            ServiceError::PolicyInUse { .. } => ProblemKind::InUse,
            ServiceError::PeriodConflict { .. } => ProblemKind::PeriodConflict,
            ServiceError::Completed { .. } => ProblemKind::SessionCompleted,
            ServiceError::Policy(_) => ProblemKind::InvalidPolicy,
            ServiceError::Draining => ProblemKind::Overloaded,
            ServiceError::Store(error) => return of_store(&error),
            ServiceError::Internal(reason) => {
                tracing::error!(reason, "a request failed");
                return Problem::new(ProblemKind::Internal, "the cause is in the log");
            }
        };
        Problem::new(kind, detail)
    }
}

fn of_store(error: &StoreError) -> Problem {
    tracing::error!(error = error as &dyn Error, "the store failed");
    let kind = match error {
        StoreError::Full { .. } => ProblemKind::StorageFull,
        StoreError::Unavailable { .. } => ProblemKind::Overloaded,
        _ => ProblemKind::Internal,
    };
    Problem::new(kind, error.to_string())
}
