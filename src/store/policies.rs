//! Policies: immutable, named by the hash of their bytes.

use futures_util::FutureExt;

use super::codec::to_sql;
use super::error::Failure;
use super::query::{Connection, Row, query};
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
        self.write(doing, move |mut connection| {
            async move { insert(&mut connection, &id, json, created_ms).await }.boxed()
        })
        .await
    }

    /// # Errors
    /// [`StoreError::Corrupt`] where the bytes no longer hash to their name.
    pub async fn policy(&self, id: &str) -> Result<Option<PolicyRow>, StoreError> {
        let find = query("SELECT policy, created_ms, json FROM policies WHERE policy = $1").bind(id);
        self.read("reading a policy", find, |rows| {
            let Some(row) = rows.first() else { return Ok(None) };
            let json: Vec<u8> = row.get("json")?;
            verify(id, &json)?;
            Ok(Some(PolicyRow { policy: row.get("policy")?, created_ms: row.get("created_ms")?, json }))
        })
        .await
    }

    /// At most `limit` policies, newest first; `after` is the `sequence` of the last row of the page before.
    pub async fn policies(&self, limit: usize, after: Option<i64>) -> Result<Vec<PolicySummary>, StoreError> {
        let page = query(
            "SELECT sequence, policy, created_ms, CAST(length(json) AS BIGINT) AS bytes FROM policies
             WHERE sequence < $1 ORDER BY sequence DESC LIMIT $2",
        );
        let page = page.bind(after.unwrap_or(i64::MAX)).bind(to_sql(limit));
        self.read("listing policies", page, |rows| rows.iter().map(PolicySummary::from_row).collect()).await
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
    connection: &mut Connection<'_>,
    id: &str,
    json: Vec<u8>,
    created_ms: i64,
) -> Result<bool, Failure> {
    let insert =
        query("INSERT INTO policies (policy, created_ms, json) VALUES ($1, $2, $3) ON CONFLICT (policy) DO NOTHING");
    Ok(connection.execute(insert.bind(id).bind(created_ms).bind(json)).await? > 0)
}

/// The policy stays locked while its sessions are counted: none can be opened in between.
async fn delete(mut connection: Connection<'_>, id: String) -> Result<DeletePolicy, Failure> {
    let lock = query("SELECT sequence FROM policies WHERE policy = $1").bind(id.as_str()).for_update();
    if connection.row(lock).await?.is_none() {
        return Ok(DeletePolicy::Absent);
    }
    let count = query("SELECT count(*) AS sessions FROM sessions WHERE policy = $1").bind(id.as_str());
    let sessions: i64 = connection.row(count).await?.map_or(Ok(0), |row| row.get("sessions"))?;
    if sessions > 0 {
        return Ok(DeletePolicy::InUse { sessions: sessions.unsigned_abs() });
    }
    connection.execute(query("DELETE FROM policies WHERE policy = $1").bind(id)).await?;
    Ok(DeletePolicy::Deleted)
}

impl PolicySummary {
    fn from_row(row: &Row) -> Result<Self, Failure> {
        Ok(PolicySummary {
            sequence: row.get("sequence")?,
            policy: row.get("policy")?,
            created_ms: row.get("created_ms")?,
            bytes: row.get::<i64>("bytes")?.unsigned_abs(),
        })
    }
}
