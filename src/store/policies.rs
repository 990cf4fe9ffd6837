//! Policies: immutable, named by the hash of their bytes.

use super::{Store, StoreError};

/// A policy as stored, its bytes verified against its name.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicyRow {
    pub policy: String,
    pub created_ms: i64,
    pub json: Vec<u8>,
}

/// A policy without its bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicySummary {
    /// Order of creation; the cursor of [`Store::policies`].
    pub sequence: i64,
    pub policy: String,
    pub created_ms: i64,
    /// Length of its portable form.
    pub bytes: u64,
}

/// What became of a request to delete a policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeletePolicy {
    Deleted,
    Absent,
    /// Sessions live by it; it stays.
    InUse {
        sessions: u64,
    },
}

impl Store {
    /// Stores a policy under its content hash. False where it existed.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] where `id` is not the hash of `json`.
    pub async fn insert_policy(&self, id: &str, json: &[u8], created_ms: i64) -> Result<bool, StoreError> {
        let _ = (id, json, created_ms);
        todo!()
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the bytes no longer hash to their name.
    pub async fn policy(&self, id: &str) -> Result<Option<PolicyRow>, StoreError> {
        let _ = id;
        todo!()
    }

    /// At most `limit` policies, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn policies(&self, limit: usize, after: Option<i64>) -> Result<Vec<PolicySummary>, StoreError> {
        let _ = (limit, after);
        todo!()
    }

    pub async fn delete_policy(&self, id: &str) -> Result<DeletePolicy, StoreError> {
        let _ = id;
        todo!()
    }
}
