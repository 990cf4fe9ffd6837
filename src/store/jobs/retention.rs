//! Deletion of ended jobs, by their tenant or by age, and the space that deleted rows leave.
//!
//! A job is deleted with its report and its idempotency key, so a key is valid as long as its job exists. The policy
//! that a job made stays. A job that has not ended is cancelled instead of deleted.

use futures_util::FutureExt;

use crate::store::engine::codec::to_sql;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, query};
use crate::store::jobs::find;
use crate::store::jobs::job::JobRow;
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Quotas, ROW_BYTES, Usage};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Engine, Store, StoreError};

/// The outcome of a request to delete a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeleteJob {
    Deleted,
    /// The tenant has no such job.
    Absent,
    /// It is queued or running; it stays.
    NotEnded,
}

/// The space a store takes, in bytes, as far as the engine reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoreSpace {
    /// Size of the database.
    pub database: u64,
    /// Size of its free pages.
    pub free: Option<u64>,
    /// Size of the write-ahead log.
    pub log: Option<u64>,
    /// Free space on the file system.
    pub disk_left: Option<u64>,
}

impl Store {
    /// Deletes an ended job of a tenant, its report and its idempotency key.
    pub async fn delete_job(&self, tenant: &Tenant, job: &str) -> Result<DeleteJob, StoreError> {
        let (tenant, job, actor) = (tenant.clone(), job.to_owned(), self.actor.clone());
        self.write("deleting a job", move |connection| delete(connection, tenant, job, actor).boxed()).await
    }

    /// Deletes at most `limit` jobs that ended before `ended_before_ms`, oldest first, and returns how many.
    pub async fn expire_jobs(&self, ended_before_ms: i64, limit: usize) -> Result<usize, StoreError> {
        self.write("deleting old jobs", move |connection| expire(connection, ended_before_ms, limit).boxed()).await
    }

    /// Returns the space the store takes.
    pub async fn room(&self) -> Result<StoreSpace, StoreError> {
        match &self.engine {
            Engine::Sqlite(folder) => folder.room().await,
            Engine::Postgres(database) => {
                Ok(StoreSpace { database: database.size().await?, free: None, log: None, disk_left: None })
            }
        }
    }

    /// Returns at most `pages` free pages to the file system; the file shrinks once the log is copied into it.
    /// PostgreSQL does this by itself.
    pub async fn give_back_pages(&self, pages: u32) -> Result<(), StoreError> {
        match &self.engine {
            Engine::Sqlite(folder) => folder.give_back_pages(pages).await,
            Engine::Postgres(_) => Ok(()),
        }
    }
}

async fn delete(
    mut connection: StoreConnection<'_>,
    tenant: Tenant,
    job: String,
    actor: Actor,
) -> Result<DeleteJob, Failure> {
    let connection = &mut connection;
    let row = match find(connection, &job).await?.filter(|row| row.tenant == tenant) {
        None => return Ok(DeleteJob::Absent),
        Some(row) if !row.state.is_terminal() => return Ok(DeleteJob::NotEnded),
        Some(row) => row,
    };
    remove(connection, &row).await?;
    let outcome = format!("deleted, {}", row.state.as_str());
    audit_chain::record(connection, (Quotas::NONE, &actor), &tenant, AuditAction::DeleteJob, &job, &outcome).await?;
    Ok(DeleteJob::Deleted)
}

/// Deletes ended jobs sorted by tenant, so that two concurrent calls lock the totals of tenants in the same order.
async fn expire(mut connection: StoreConnection<'_>, before_ms: i64, limit: usize) -> Result<usize, Failure> {
    let ended = query("SELECT * FROM jobs WHERE finished_ms < $1 ORDER BY finished_ms LIMIT $2");
    let ended = connection.rows(ended.bind(before_ms).bind(to_sql(limit)).for_update_of_free()).await?;
    let mut ended: Vec<_> = ended.iter().map(JobRow::from_row).collect::<Result<_, _>>()?;
    ended.sort_by(|one, other| one.tenant.as_str().cmp(other.tenant.as_str()));
    for row in &ended {
        remove(&mut connection, row).await?;
    }
    Ok(ended.len())
}

async fn remove(connection: &mut StoreConnection<'_>, row: &JobRow) -> Result<(), Failure> {
    let job = row.job.as_str();
    let report = query("DELETE FROM job_reports WHERE job = $1 RETURNING CAST(octet_length(json) AS BIGINT) AS bytes");
    let report = connection.row(report.bind(job)).await?;
    let bytes: i64 = report.map_or(Ok(0), |row| row.get("bytes"))?;
    connection.execute(query("DELETE FROM jobs WHERE job = $1").bind(job)).await?;
    quotas::change(connection, &row.tenant, Usage::of_bytes(ROW_BYTES + bytes).negated()).await.map(drop)
}
