//! Sessions: where a live investor started.

use super::{Store, StoreError};

/// A session to open.
#[derive(Debug, Clone, PartialEq)]
pub struct NewSession {
    pub session: String,
    pub policy: String,
    pub wealth: f64,
    /// The log-returns known at the start.
    pub history: Vec<f64>,
    pub horizon: usize,
    pub created_ms: i64,
}

/// What became of a [`NewSession`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CreateSession {
    Created,
    /// There is no such policy.
    NoPolicy,
    /// The identifier is taken.
    Exists,
}

/// The start of a session, verified against its digest.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionRow {
    pub session: String,
    pub policy: String,
    pub initial_wealth: f64,
    pub initial_history: Vec<f64>,
    pub horizon: usize,
    pub created_ms: i64,
}

/// A session without its history.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionSummary {
    /// Order of creation; the cursor of [`Store::sessions`].
    pub sequence: i64,
    pub session: String,
    pub policy: String,
    pub initial_wealth: f64,
    pub horizon: usize,
    pub created_ms: i64,
    /// Number of periods observed.
    pub observations: usize,
}

impl Store {
    pub async fn create_session(&self, new: NewSession) -> Result<CreateSession, StoreError> {
        let _ = new;
        todo!()
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the row is not what was written.
    pub async fn session(&self, session: &str) -> Result<Option<SessionRow>, StoreError> {
        let _ = session;
        todo!()
    }

    /// At most `limit` sessions, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn sessions(&self, limit: usize, after: Option<i64>) -> Result<Vec<SessionSummary>, StoreError> {
        let _ = (limit, after);
        todo!()
    }

    /// Deletes a session and its observations. False where there was none.
    pub async fn delete_session(&self, session: &str) -> Result<bool, StoreError> {
        let _ = session;
        todo!()
    }

    pub async fn count_sessions(&self) -> Result<u64, StoreError> {
        todo!()
    }
}
