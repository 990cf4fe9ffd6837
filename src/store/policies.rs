//! Policies: immutable, named by the hash of their bytes.

use futures_util::FutureExt;
use sqlx::SqliteConnection;

use super::codec::to_sql;
use super::error::Failure;
use super::{Store, StoreError};
use crate::control::policy::content_hash;

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
        let doing = "inserting a policy";
        verify(id, json).map_err(|failure| failure.during(doing))?;
        let (id, json) = (id.to_owned(), json.to_vec());
        self.write(doing, move |connection| async move { insert(connection, &id, json, created_ms).await }.boxed())
            .await
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the bytes no longer hash to their name.
    pub async fn policy(&self, id: &str) -> Result<Option<PolicyRow>, StoreError> {
        let row = sqlx::query_as("SELECT policy, created_ms, json FROM policies WHERE policy = ?")
            .bind(id)
            .fetch_optional(&self.readers);
        self.read("reading a policy", async {
            let row: Option<(String, i64, Vec<u8>)> = row.await?;
            let Some((policy, created_ms, json)) = row else { return Ok(None) };
            verify(id, &json)?;
            Ok(Some(PolicyRow { policy, created_ms, json }))
        })
        .await
    }

    /// At most `limit` policies, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn policies(&self, limit: usize, after: Option<i64>) -> Result<Vec<PolicySummary>, StoreError> {
        let rows = sqlx::query_as(
            "SELECT sequence, policy, created_ms, length(json) FROM policies
             WHERE sequence < ? ORDER BY sequence DESC LIMIT ?",
        )
        .bind(after.unwrap_or(i64::MAX))
        .bind(to_sql(limit))
        .fetch_all(&self.readers);
        self.read("listing policies", async {
            let rows: Vec<(i64, String, i64, i64)> = rows.await?;
            let summary = |(sequence, policy, created_ms, bytes): (i64, String, i64, i64)| PolicySummary {
                sequence,
                policy,
                created_ms,
                bytes: bytes.unsigned_abs(),
            };
            Ok(rows.into_iter().map(summary).collect())
        })
        .await
    }

    pub async fn delete_policy(&self, id: &str) -> Result<DeletePolicy, StoreError> {
        let id = id.to_owned();
        self.write("deleting a policy", move |connection| delete(connection, id).boxed()).await
    }
}

pub(super) fn verify(id: &str, json: &[u8]) -> Result<(), Failure> {
    if content_hash(json) == id { Ok(()) } else { Err(Failure::Corrupt(format!("policy {id}"))) }
}

pub(super) async fn insert(
    connection: &mut SqliteConnection,
    id: &str,
    json: Vec<u8>,
    created_ms: i64,
) -> Result<bool, Failure> {
    let inserted =
        sqlx::query("INSERT INTO policies (policy, created_ms, json) VALUES (?, ?, ?) ON CONFLICT (policy) DO NOTHING")
            .bind(id)
            .bind(created_ms)
            .bind(json)
            .execute(connection)
            .await?;
    Ok(inserted.rows_affected() > 0)
}

async fn delete(connection: &mut SqliteConnection, id: String) -> Result<DeletePolicy, Failure> {
    let sessions: i64 = sqlx::query_scalar("SELECT count(*) FROM sessions WHERE policy = ?")
        .bind(&id)
        .fetch_one(&mut *connection)
        .await?;
    if sessions > 0 {
        return Ok(DeletePolicy::InUse { sessions: sessions.unsigned_abs() });
    }
    let deleted = sqlx::query("DELETE FROM policies WHERE policy = ?").bind(id).execute(connection).await?;
    Ok(if deleted.rows_affected() > 0 { DeletePolicy::Deleted } else { DeletePolicy::Absent })
}
