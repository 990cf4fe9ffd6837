//! Observations: append-only, numbered by period from 1, each stored exactly once.

use super::{Store, StoreError};

/// One period's return and what was answered to it.
#[derive(Debug, Clone, PartialEq)]
pub struct NewObservation {
    pub session: String,
    pub period: usize,
    /// Hash of what the user reported: tells a repeat from other content under the same period.
    pub content_hash: String,
    pub log_return: f64,
    pub executed_allocation: f64,
    pub advised_allocation: f64,
    pub wealth_after: f64,
    pub answer_json: String,
    pub created_ms: i64,
}

/// An observation as stored, verified against its digest.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationRow {
    pub period: usize,
    pub content_hash: String,
    pub log_return: f64,
    pub executed_allocation: f64,
    pub advised_allocation: f64,
    pub wealth_after: f64,
    pub answer_json: String,
    pub created_ms: i64,
}

/// What became of a [`NewObservation`].
#[derive(Debug, Clone, PartialEq)]
pub enum Append {
    Appended,
    /// The period was reported with the same content: the first answer.
    Repeated {
        answer_json: String,
    },
    /// The period was reported with other content.
    Conflict,
    /// Not the period after the last.
    OutOfOrder {
        expected: usize,
    },
    NoSession,
}

impl Store {
    /// Appends the period after the last, or says why not; decided and written in one transaction.
    pub async fn append_observation(&self, new: NewObservation) -> Result<Append, StoreError> {
        let _ = new;
        todo!()
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the row is not what was written.
    pub async fn observation(&self, session: &str, period: usize) -> Result<Option<ObservationRow>, StoreError> {
        let _ = (session, period);
        todo!()
    }

    /// Every observation of the session, ascending by period; empty where there is no such session.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] where a row is not what was written or a period is missing.
    pub async fn observations(&self, session: &str) -> Result<Vec<ObservationRow>, StoreError> {
        let _ = session;
        todo!()
    }
}
